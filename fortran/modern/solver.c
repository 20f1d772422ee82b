/* The call of a prepared solver, from the interpreter into the kernel with no Python code between.
   Arguments are inspected, not converted; those that are not plainly valid go to a check in Python.

   The kernel is f2py's. Its address comes from f2py's module, so that no Fortran is linked twice.
   The kernel only reads the packed array and writes to the stack of this call, so threads may share
   a solver. */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <stddef.h>

#define NPY_NO_DEPRECATED_API NPY_2_0_API_VERSION
#define NPY_TARGET_VERSION NPY_2_0_API_VERSION
#include <numpy/arrayobject.h>

#include "codes.h"
#include "pyharness.h"

/* The type of solve_packed in api.f90, for three numbers; or of solve_packed_attitude, for
   seven. */
typedef void kernel(const double *packed, const int *n_packed, const double *start,
                    const double *t_end, double *state, int *status, int64_t *steps,
                    double *found);

enum { OMEGA = 3, ATTITUDE = 4, MOST = OMEGA + ATTITUDE }; /* numbers in each */

/* The outcome of a thread's last call, and its arguments: the amplification over a closed form is
   computed only when it is requested. A thread's number is never used again, but its address may
   be. */
typedef struct {
  uint64_t thread;
  int status;
  int64_t steps;
  double found[3]; /* estimated error, amplification, steps in all; negative: unknown */
  double start[3];
  double time;
} ending;

typedef struct {
  PyObject_HEAD
  vectorcallfunc vectorcall;
  PyObject *callable;    /* the kernel as a Python object */
  kernel *address;       /* NULL if the kernel is not f2py's; it is then called through Python */
  PyArrayObject *packed; /* read-only */
  /* The same scene for the closed form alone, or NULL. This call keeps the GIL, as it is shorter
     than releasing the GIL and waiting for it again. */
  PyArrayObject *packed_with_gil;
  pyharness_solver exported; /* the same for compiled callers */
  PyObject *check;       /* (omega0, t_end, third) -> (floats of a start, float), or InputError */
  int width;             /* numbers in a start: OMEGA or MOST */
  double attitude[ATTITUDE]; /* at time 0, for a call that specifies none */
  double span[2];        /* times (s) between which a call needs no check */
  int has_axes;          /* whether the kernel's axes, the principal ones, are other than a call's */
  double axes[OMEGA][OMEGA]; /* the principal axes, in columns */
  double turn[ATTITUDE]; /* the same as a quaternion, from principal axes to a call's */
  ending *endings;
  Py_ssize_t n_endings;
  Py_ssize_t room;
  Py_ssize_t latest; /* index of the last call's ending */
} bound_kernel;

/* Largest deviation of a squared norm from 1 with which a quaternion is used without
   normalisation. */
#define ROUNDED 0x1p-51

static PyObject *out_name; /* interned, like the compiler's names of keywords */
static npy_intp three[1] = {OMEGA}, four[1] = {ATTITUDE};

/* ---- Endings ------------------------------------------------------------------------------ */

static ending *find_ending(bound_kernel *self, uint64_t thread)
{
  if (self->latest < self->n_endings && self->endings[self->latest].thread == thread) {
    return self->endings + self->latest;
  }
  for (Py_ssize_t i = 0; i < self->n_endings; i++) {
    if (self->endings[i].thread == thread) {
      self->latest = i;
      return self->endings + i;
    }
  }
  return NULL;
}

static int is_running(uint64_t thread)
{
  PyThreadState *each = PyInterpreterState_ThreadHead(PyInterpreterState_Get());
  for (; each != NULL; each = PyThreadState_Next(each)) {
    if (PyThreadState_GetID(each) == thread) return 1;
  }
  return 0;
}

/* Add an entry for a thread. Entries of threads that have ended are removed first, so that there
   are never more than four times as many entries as there were threads at once. */
static ending *add_ending(bound_kernel *self, uint64_t thread)
{
  if (self->n_endings == self->room) {
    Py_ssize_t kept = 0;
    for (Py_ssize_t i = 0; i < self->n_endings; i++) {
      if (is_running(self->endings[i].thread)) self->endings[kept++] = self->endings[i];
    }
    self->n_endings = kept;
    if (2 * kept >= self->room) {
      const Py_ssize_t room = self->room ? 2 * self->room : 2;
      ending *grown = PyMem_Realloc(self->endings, (size_t)room * sizeof(ending));
      if (grown == NULL) {
        PyErr_NoMemory();
        return NULL;
      }
      self->endings = grown;
      self->room = room;
    }
  }
  self->latest = self->n_endings++;
  self->endings[self->latest] = (ending){.thread = thread, .found = {-1.0, -1.0, -1.0}};
  return self->endings + self->latest;
}

static PyObject *get_ending(PyObject *object, void *Py_UNUSED(closure))
{
  const ending *own =
    find_ending((bound_kernel *)object, PyThreadState_GetID(PyThreadState_Get()));
  if (own == NULL) Py_RETURN_NONE;
  return Py_BuildValue("(iLddd(ddd)d)", own->status, (long long)own->steps, own->found[0],
                       own->found[1], own->found[2], own->start[0], own->start[1], own->start[2], own->time);
}

/* ---- Arguments ---------------------------------------------------------------------------- */

typedef struct {
  PyObject *omega0;
  PyObject *t_end;
  PyObject *third; /* out or attitude0; or None */
} arguments;

/* Store each argument in its place, by position or name, as the solver's signature says. */
static int sort_arguments(arguments *found, int width, PyObject *const *given, Py_ssize_t count,
                          PyObject *names)
{
  const int with_attitude = width > OMEGA;
  const char *const known[] = {"omega", "t_end", with_attitude ? "attitude" : "out"};
  const char *const signature = with_attitude ? "solver(omega, t_end, attitude=None)"
                                              : "solver(omega, t_end, *, out=None)";
  const int most = with_attitude ? 3 : 2;
  PyObject **const places[] = {&found->omega0, &found->t_end, &found->third};
  const Py_ssize_t n_names = names ? PyTuple_GET_SIZE(names) : 0;

  if (count > most) {
    PyErr_Format(PyExc_TypeError, "%s takes %d positional arguments but %zd were given", signature,
                 most, count);
    return 0;
  }
  for (Py_ssize_t i = 0; i < count; i++) *places[i] = given[i];
  for (Py_ssize_t i = 0; i < n_names; i++) {
    PyObject *name = PyTuple_GET_ITEM(names, i);
    int k = 0;
    while (k < 3 && PyUnicode_CompareWithASCIIString(name, known[k]) != 0) k++;
    if (k == 3) {
      PyErr_Format(PyExc_TypeError, "%s got an unexpected keyword argument '%U'", signature, name);
      return 0;
    }
    if (*places[k] != NULL) {
      PyErr_Format(PyExc_TypeError, "%s got multiple values for argument '%s'", signature,
                   known[k]);
      return 0;
    }
    *places[k] = given[count + i];
  }
  for (int k = 0; k < 2; k++) {
    if (*places[k] == NULL) {
      PyErr_Format(PyExc_TypeError, "%s missing argument '%s'", signature, known[k]);
      return 0;
    }
  }
  if (found->third == NULL) found->third = Py_None;
  return 1;
}

static inline int is_of(int count, PyArrayObject *array)
{
  return PyArray_NDIM(array) == 1 && PyArray_DIM(array, 0) == count;
}

/* Whether a NumPy number is in the range of a double: longdouble and timedelta64 are excluded. */
static int is_narrow(PyObject *object)
{
  return PyArray_IsScalar(object, Floating)  ? !PyArray_IsScalar(object, LongDouble)
         : PyArray_IsScalar(object, Integer) ? !PyArray_IsScalar(object, Timedelta)
                                             : 0;
}

static inline int read_number(PyObject *object, double *number)
{
  if (PyFloat_Check(object)) {
    *number = PyFloat_AS_DOUBLE(object);
    return 1;
  }
  if (PyLong_CheckExact(object)) {
    int is_beyond;
    const long whole = PyLong_AsLongAndOverflow(object, &is_beyond);
    *number = (double)whole;
    return !is_beyond;
  }
  if (!is_narrow(object)) return 0;
  *number = PyFloat_AsDouble(object);
  if (!PyErr_Occurred()) return 1;
  PyErr_Clear();
  return 0;
}

/* Read an array of another type of number, or with another layout of its bytes. */
static int read_converted(PyArrayObject *array, int count, double *numbers)
{
  const int type = PyArray_TYPE(array);
  if (!PyTypeNum_ISINTEGER(type) && type != NPY_HALF && type != NPY_FLOAT && type != NPY_DOUBLE) {
    return 0;
  }
  PyArrayObject *same =
    (PyArrayObject *)PyArray_FROM_OTF((PyObject *)array, NPY_DOUBLE, NPY_ARRAY_CARRAY_RO);
  if (same == NULL) {
    PyErr_Clear();
    return 0;
  }
  memcpy(numbers, PyArray_DATA(same), (size_t)count * sizeof(double));
  Py_DECREF(same);
  return 1;
}

/* Read `count` numbers, if the object plainly has them; an array may have any stride. */
static inline int read_numbers(PyObject *object, int count, double *numbers)
{
  if (PyArray_CheckExact(object)) {
    PyArrayObject *array = (PyArrayObject *)object;
    if (!is_of(count, array)) return 0;
    if (PyArray_TYPE(array) != NPY_DOUBLE || !PyArray_ISBEHAVED_RO(array)) {
      return read_converted(array, count, numbers);
    }
    const char *data = PyArray_BYTES(array);
    const npy_intp stride = PyArray_STRIDE(array, 0);
    for (int i = 0; i < count; i++) numbers[i] = *(const double *)(data + i * stride);
    return 1;
  }
  if (PyTuple_CheckExact(object) && PyTuple_GET_SIZE(object) == count) {
    for (int i = 0; i < count; i++) {
      if (!read_number(PyTuple_GET_ITEM(object, i), numbers + i)) return 0;
    }
    return 1;
  }
  if (PyList_CheckExact(object) && PyList_GET_SIZE(object) == count) {
    for (int i = 0; i < count; i++) {
      if (!read_number(PyList_GET_ITEM(object, i), numbers + i)) return 0;
    }
    return 1;
  }
  return 0;
}

/* Read an attitude that needs no normalisation. */
static inline int read_unit(PyObject *object, double *q)
{
  if (!read_numbers(object, ATTITUDE, q)) return 0;
  const double off = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1.0;
  return -ROUNDED <= off && off <= ROUNDED;
}

static inline int is_buffer(PyObject *object)
{
  PyArrayObject *array = (PyArrayObject *)object;
  return PyArray_Check(object) && is_of(OMEGA, array) && PyArray_TYPE(array) == NPY_DOUBLE &&
         PyArray_ISCARRAY(array);
}

/* Read the third argument: check `out`, or store an attitude after omega. */
static inline int read_third(const bound_kernel *self, PyObject *third, double *start)
{
  if (self->width == OMEGA) return third == Py_None || is_buffer(third);
  if (third != Py_None) return read_unit(third, start + OMEGA);
  memcpy(start + OMEGA, self->attitude, sizeof self->attitude);
  return 1;
}

/* Let the check in Python raise an error, or convert the arguments. */
static int read_slowly(bound_kernel *self, const arguments *given, double *start, double *time)
{
  PyObject *found =
    PyObject_CallFunctionObjArgs(self->check, given->omega0, given->t_end, given->third, NULL);
  if (found == NULL) return 0;
  const int is_right = PyTuple_Check(found) && PyTuple_GET_SIZE(found) == 2 &&
                       read_numbers(PyTuple_GET_ITEM(found, 0), self->width, start) &&
                       read_number(PyTuple_GET_ITEM(found, 1), time) &&
                       (self->width > OMEGA || read_third(self, given->third, start));
  Py_DECREF(found);
  if (!is_right) PyErr_SetString(PyExc_SystemError, "the check let through what can't be read");
  return is_right;
}

/* ---- Axes --------------------------------------------------------------------------------- */

/* Hamilton's product p q, with the sums of `product` in Python. */
static void multiply(const double *p, const double *q, double *result)
{
  const double a = p[0], b = p[1], c = p[2], d = p[3], e = q[0], f = q[1], g = q[2], h = q[3];
  result[0] = a * e - b * f - c * g - d * h;
  result[1] = a * f + b * e + c * h - d * g;
  result[2] = a * g - b * h + c * e + d * f;
  result[3] = a * h + b * g - c * f + d * e;
}

/* Convert a state to principal axes in place. */
static void to_principal(const bound_kernel *self, double *state)
{
  const double x = state[0], y = state[1], z = state[2];
  for (int i = 0; i < OMEGA; i++) {
    state[i] = (self->axes[0][i] * x + self->axes[1][i] * y) + self->axes[2][i] * z;
  }
  if (self->width > OMEGA) multiply(state + OMEGA, self->turn, state + OMEGA);
}

static void from_principal(const bound_kernel *self, double *state)
{
  const double x = state[0], y = state[1], z = state[2], *t = self->turn;
  for (int i = 0; i < OMEGA; i++) {
    state[i] = (self->axes[i][0] * x + self->axes[i][1] * y) + self->axes[i][2] * z;
  }
  const double back[ATTITUDE] = {t[0], -t[1], -t[2], -t[3]};
  if (self->width > OMEGA) multiply(state + OMEGA, back, state + OMEGA);
}

/* ---- The call ----------------------------------------------------------------------------- */

/* Copy numbers that a kernel other than f2py's returned. */
static int copy_numbers(PyObject *values, npy_intp count, double *numbers)
{
  PyArrayObject *array =
    (PyArrayObject *)PyArray_FROM_OTF(values, NPY_DOUBLE, NPY_ARRAY_CARRAY_RO);
  if (array == NULL) return 0;
  const int is_right = PyArray_NDIM(array) == 1 && PyArray_DIM(array, 0) == count;
  if (is_right) memcpy(numbers, PyArray_DATA(array), (size_t)count * sizeof(double));
  else PyErr_Format(PyExc_ValueError, "the kernel returned no %d numbers", (int)count);
  Py_DECREF(array);
  return is_right;
}

/* Call a kernel other than f2py's, which is a Python callable. */
static int call_object(bound_kernel *self, const double *start, double *state, ending *now)
{
  int is_right = 0;
  long long steps = 0;
  PyObject *result = NULL, *values, *found;
  npy_intp width[1] = {self->width};
  PyObject *given = PyArray_SimpleNew(1, width, NPY_DOUBLE);
  if (given == NULL) return 0;
  memcpy(PyArray_DATA((PyArrayObject *)given), start, (size_t)self->width * sizeof(double));
  result = PyObject_CallFunction(self->callable, "OOd", self->packed, given, now->time);
  if (result != NULL && !PyTuple_Check(result)) {
    PyErr_SetString(PyExc_TypeError, "the kernel returned no tuple");
  } else if (result != NULL &&
             PyArg_ParseTuple(result, "OiLO", &values, &now->status, &steps, &found)) {
    now->steps = steps;
    is_right = copy_numbers(values, self->width, state) && copy_numbers(found, 3, now->found);
  }
  Py_XDECREF(result);
  Py_DECREF(given);
  return is_right;
}

static inline void enter(const bound_kernel *self, PyArrayObject *packed, const double *start,
                         double *state, ending *now)
{
  const int n_packed = (int)PyArray_DIM(packed, 0);
  self->address(PyArray_DATA(packed), &n_packed, start, &now->time, state, &now->status,
                &now->steps, now->found);
}

static PyObject *new_array(npy_intp *shape, const double *numbers)
{
  PyObject *result = PyArray_SimpleNew(1, shape, NPY_DOUBLE);
  if (result != NULL) {
    memcpy(PyArray_DATA((PyArrayObject *)result), numbers, (size_t)shape[0] * sizeof(double));
  }
  return result;
}

static PyObject *omega_and_attitude(const double *state)
{
  PyObject *omega = new_array(three, state);
  PyObject *attitude = new_array(four, state + OMEGA);
  PyObject *both = omega && attitude ? PyTuple_Pack(2, omega, attitude) : NULL;
  Py_XDECREF(omega);
  Py_XDECREF(attitude);
  return both;
}

static PyObject *call(PyObject *object, PyObject *const *given, size_t n_given, PyObject *names)
{
  bound_kernel *self = (bound_kernel *)object;
  const Py_ssize_t count = PyVectorcall_NARGS(n_given);
  arguments found = {NULL, NULL, NULL};
  double start[MOST], state[MOST];
  ending now;

  if (count == 2 && names == NULL) {
    found = (arguments){given[0], given[1], Py_None};
  } else if (self->width == OMEGA && count == 2 && PyTuple_GET_SIZE(names) == 1 &&
             PyTuple_GET_ITEM(names, 0) == out_name) {
    found = (arguments){given[0], given[1], given[2]};
  } else if (!sort_arguments(&found, self->width, given, count, names)) {
    return NULL;
  }
  if (!(read_numbers(found.omega0, OMEGA, start) && read_number(found.t_end, &now.time) &&
        read_third(self, found.third, start) && self->span[0] < now.time &&
        now.time < self->span[1])) {
    if (!read_slowly(self, &found, start, &now.time)) return NULL;
  }
  if (self->has_axes) to_principal(self, start);
  memcpy(now.start, start, sizeof now.start);

  if (self->address != NULL) {
    PyThreadState *thread = PyThreadState_Get();
    now.status = COMPLETE + 1;
    if (self->packed_with_gil != NULL) enter(self, self->packed_with_gil, start, state, &now);
    if (now.status != COMPLETE) {
      PyEval_SaveThread();
      enter(self, self->packed, start, state, &now);
      PyEval_RestoreThread(thread);
      /* A kernel polls for Ctrl-C, which ends it and sets this error. */
      if (PyErr_Occurred()) return NULL;
    }
    now.thread = PyThreadState_GetID(thread);
  } else {
    if (!call_object(self, start, state, &now)) return NULL;
    now.thread = PyThreadState_GetID(PyThreadState_Get());
  }

  ending *own = find_ending(self, now.thread);
  if (own == NULL) own = add_ending(self, now.thread);
  if (own == NULL) return NULL;
  *own = now;

  if (self->has_axes) from_principal(self, state);
  if (self->width > OMEGA) return omega_and_attitude(state);
  if (found.third == Py_None) return new_array(three, state);
  memcpy(PyArray_DATA((PyArrayObject *)found.third), state, OMEGA * sizeof(double));
  return Py_NewRef(found.third);
}

/* ---- The type ----------------------------------------------------------------------------- */

/* Return a solver's own copy of a packed array, or NULL with an error set if it is invalid. */
static PyArrayObject *own_packed(PyObject *packed)
{
  PyArrayObject *own = (PyArrayObject *)PyArray_FROM_OTF(packed, NPY_DOUBLE,
                                                         NPY_ARRAY_CARRAY | NPY_ARRAY_ENSURECOPY);
  if (own == NULL) return NULL;
  if (PyArray_NDIM(own) != 1 || PyArray_DIM(own, 0) > INT_MAX) {
    PyErr_SetString(PyExc_ValueError, "packed: allowed: one dimension");
    Py_CLEAR(own);
  } else {
    PyArray_CLEARFLAGS(own, NPY_ARRAY_WRITEABLE);
  }
  return own;
}

/* Read the principal axes, three rows, and the quaternion. */
static int read_axes(bound_kernel *self, PyObject *axes)
{
  PyObject *rows[OMEGA], *turn;
  if (!PyArg_ParseTuple(axes, "(OOO)O", rows, rows + 1, rows + 2, &turn)) return 0;
  int is_right = read_numbers(turn, ATTITUDE, self->turn);
  for (int i = 0; i < OMEGA; i++) {
    is_right = is_right && read_numbers(rows[i], OMEGA, self->axes[i]);
  }
  if (!is_right) PyErr_SetString(PyExc_ValueError, "axes: allowed: 3 x 3 and 4 numbers");
  return is_right;
}

static PyObject *new_kernel(PyTypeObject *type, PyObject *args, PyObject *names)
{
  static char *known[] = {"kernel",   "packed", "check", "packed_with_gil",
                          "attitude", "span",   "axes",  NULL};
  PyObject *callable, *packed, *check, *packed_with_gil = Py_None, *attitude = Py_None,
                                       *axes = Py_None;
  double span[2] = {-HUGE_VAL, HUGE_VAL};
  if (!PyArg_ParseTupleAndKeywords(args, names, "OOO|OO(dd)O", known, &callable, &packed, &check,
                                   &packed_with_gil, &attitude, span, span + 1, &axes)) {
    return NULL;
  }
  bound_kernel *self = (bound_kernel *)type->tp_alloc(type, 0);
  if (self == NULL) return NULL;
  self->vectorcall = call;
  self->callable = Py_NewRef(callable);
  self->check = Py_NewRef(check);
  self->width = attitude == Py_None ? OMEGA : MOST;
  memcpy(self->span, span, sizeof span);
  self->has_axes = axes != Py_None;
  if (self->width > OMEGA && !read_numbers(attitude, ATTITUDE, self->attitude)) {
    PyErr_SetString(PyExc_ValueError, "attitude: allowed: four numbers");
    goto failed;
  }
  if (self->has_axes && !read_axes(self, axes)) goto failed;
  PyObject *address = PyObject_GetAttrString(callable, "_cpointer");
  if (address != NULL) {
    self->address = (kernel *)PyCapsule_GetPointer(address, PyCapsule_GetName(address));
    Py_DECREF(address);
    if (self->address == NULL) goto failed;
  } else if (PyErr_ExceptionMatches(PyExc_AttributeError)) {
    PyErr_Clear();
  } else {
    goto failed;
  }
  self->packed = own_packed(packed);
  if (self->packed == NULL) goto failed;
  if (packed_with_gil != Py_None) {
    self->packed_with_gil = own_packed(packed_with_gil);
    if (self->packed_with_gil == NULL) goto failed;
  }
  self->exported = (pyharness_solver){
    .kernel = self->address,
    .numbers = PyArray_DATA(self->packed),
    .n_numbers = (int)PyArray_DIM(self->packed, 0),
    .width = self->width,
  };
  if (self->packed_with_gil != NULL) {
    self->exported.first = PyArray_DATA(self->packed_with_gil);
    self->exported.n_first = (int)PyArray_DIM(self->packed_with_gil, 0);
  }
  return (PyObject *)self;
failed:
  Py_DECREF(self);
  return NULL;
}

/* Before Python 3.12 a class does not inherit the fast call, although it could: nothing in it is
   overridden. */
static PyObject *init_subclass(PyObject *class, PyObject *Py_UNUSED(unused))
{
#if PY_VERSION_HEX < 0x030C0000
  PyTypeObject *type = (PyTypeObject *)class;
  if (type->tp_call == PyVectorcall_Call) type->tp_flags |= Py_TPFLAGS_HAVE_VECTORCALL;
#else
  (void)class;
#endif
  Py_RETURN_NONE;
}

static int traverse(PyObject *object, visitproc visit, void *arg)
{
  bound_kernel *self = (bound_kernel *)object;
  Py_VISIT(self->callable);
  Py_VISIT(self->packed);
  Py_VISIT(self->packed_with_gil);
  Py_VISIT(self->check);
  return 0;
}

static void dealloc(PyObject *object)
{
  bound_kernel *self = (bound_kernel *)object;
  PyObject_GC_UnTrack(object);
  Py_XDECREF(self->callable);
  Py_XDECREF(self->packed);
  Py_XDECREF(self->packed_with_gil);
  Py_XDECREF(self->check);
  PyMem_Free(self->endings);
  Py_TYPE(object)->tp_free(object);
}

static PyObject *size_of(PyObject *object, PyObject *Py_UNUSED(unused))
{
  const size_t places = (size_t)((bound_kernel *)object)->room * sizeof(ending);
  return PyLong_FromSize_t((size_t)Py_TYPE(object)->tp_basicsize + places);
}

/* ---- Compiled callers --------------------------------------------------------------------- */

static void release(PyObject *capsule) { Py_XDECREF((PyObject *)PyCapsule_GetContext(capsule)); }

/* Return whether compiled callers can have the solver; set an error if not. */
static int has_address(const bound_kernel *self)
{
  if (self->has_axes) {
    PyErr_SetString(PyExc_AttributeError,
                    "a solver for a full inertia matrix has no compiled call; allowed: a solver "
                    "for the scene that `principal` returns");
  } else if (self->address == NULL) {
    PyErr_SetString(PyExc_AttributeError, "the kernel is a Python object");
  }
  return !self->has_axes && self->address != NULL;
}

/* Return a capsule with the address of `exported`, which keeps this solver. */
static PyObject *get_capsule(PyObject *object, void *Py_UNUSED(closure))
{
  bound_kernel *self = (bound_kernel *)object;
  if (!has_address(self)) return NULL;
  PyObject *capsule = PyCapsule_New(&self->exported, PYHARNESS_SOLVER, release);
  if (capsule != NULL && PyCapsule_SetContext(capsule, Py_NewRef(object)) < 0) {
    Py_DECREF(object);
    Py_CLEAR(capsule);
  }
  return capsule;
}

/* pyharness_solve without an estimate, for callers that have its address alone. */
static int solve_at(const pyharness_solver *solver, const double *start, double t_end, double *state)
{
  return pyharness_solve(solver, start, t_end, state, NULL);
}

static PyObject *get_address(PyObject *object, void *Py_UNUSED(closure))
{
  if (!has_address((bound_kernel *)object)) return NULL;
  return PyLong_FromVoidPtr(&((bound_kernel *)object)->exported);
}

static PyMethodDef methods[] = {
  {"__sizeof__", size_of, METH_NOARGS, NULL},
  {"__init_subclass__", init_subclass, METH_CLASS | METH_NOARGS, NULL},
  {"__class_getitem__", Py_GenericAlias, METH_CLASS | METH_O, "See PEP 585."},
  {NULL, NULL, 0, NULL},
};

static PyGetSetDef attributes[] = {
  {"_ending", get_ending, NULL,
   "Status, steps, error, growth, omega0 and t_end of this thread's last call; None before one.",
   NULL},
  {"capsule", get_capsule, NULL,
   "A capsule with the address of a pyharness_solver, for compiled code; see pyharness.h.", NULL},
  {"_address", get_address, NULL, "The address of the pyharness_solver.", NULL},
  {NULL, NULL, NULL, NULL, NULL},
};

static PyTypeObject bound_kernel_type = {
  PyVarObject_HEAD_INIT(NULL, 0)
  .tp_name = "pyharness._solver.BoundKernel",
  .tp_doc = "A kernel with what it is given in every call.",
  .tp_basicsize = sizeof(bound_kernel),
  .tp_flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE | Py_TPFLAGS_HAVE_GC |
              Py_TPFLAGS_HAVE_VECTORCALL,
  .tp_new = new_kernel,
  .tp_call = PyVectorcall_Call,
  .tp_vectorcall_offset = offsetof(bound_kernel, vectorcall),
  .tp_traverse = traverse,
  .tp_dealloc = dealloc,
  .tp_methods = methods,
  .tp_getset = attributes,
};

static struct PyModuleDef module = {
  PyModuleDef_HEAD_INIT,
  .m_name = "pyharness._solver",
  .m_size = -1,
};

PyMODINIT_FUNC PyInit__solver(void)
{
  import_array();
  out_name = PyUnicode_InternFromString("out");
  if (out_name == NULL || PyType_Ready(&bound_kernel_type) < 0) return NULL;
  PyObject *created = PyModule_Create(&module);
  /* A union, because C converts no address of a function to one of data. */
  const union {
    int (*function)(const pyharness_solver *, const double *, double, double *);
    void *address;
  } entry = {solve_at};
  PyObject *address = PyLong_FromVoidPtr(entry.address);
  if (created != NULL && (address == NULL || PyModule_AddObjectRef(created, "SOLVE_AT", address) < 0))
    Py_CLEAR(created);
  Py_XDECREF(address);
  if (created != NULL &&
      PyModule_AddObjectRef(created, "BoundKernel", (PyObject *)&bound_kernel_type) < 0) {
    Py_CLEAR(created);
  }
  return created;
}
