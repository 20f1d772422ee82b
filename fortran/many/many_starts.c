/* Many starts of a prepared solver: the call from the interpreter into the kernel, with no Python
   code between. Arguments that are not plainly valid, or need conversion, go to a function in
   Python. */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <stddef.h>

#define NPY_NO_DEPRECATED_API NPY_2_0_API_VERSION
#define NPY_TARGET_VERSION NPY_2_0_API_VERSION
#include <numpy/arrayobject.h>

#include "codes.h"

/* The type of solve_packed_many in api_many.f90. */
typedef void kernel(const double *packed, const int *n_packed, const int *n, const double *omega0,
                    const int *n_times, const double *times, int *given_up, double *omega,
                    int8_t *status, int *raised);

typedef struct {
  PyObject_HEAD
  vectorcallfunc vectorcall;
  PyObject *callable;    /* the kernel as a Python object, which keeps its address valid */
  kernel *address;
  PyArrayObject *packed; /* read-only */
  /* The same scene for the closed form alone, whose call keeps the GIL; or NULL. */
  PyArrayObject *packed_with_gil;
  PyObject *slowly;      /* Python function that takes any arguments */
} many_starts;

enum { FEW = 16 };

static int is_plain(PyObject *object, int dimensions)
{
  PyArrayObject *array = (PyArrayObject *)object;
  return PyArray_CheckExact(object) && PyArray_NDIM(array) == dimensions &&
         PyArray_TYPE(array) == NPY_DOUBLE && PyArray_ISCARRAY_RO(array);
}

/* Return whether `object`, the argument `out`, can take the results of the n bodies of `start`. The
   kernel may write a result before it reads the start again, so that they may not overlap. */
static int is_place(PyObject *object, PyArrayObject *start, npy_intp n)
{
  PyArrayObject *array = (PyArrayObject *)object;
  if (!is_plain(object, 2) || !PyArray_ISWRITEABLE(array)) return 0;
  const char *own = PyArray_BYTES(array), *other = PyArray_BYTES(start);
  return PyArray_DIM(array, 0) == n && PyArray_DIM(array, 1) == 3 &&
         (own + PyArray_NBYTES(array) <= other || other + PyArray_NBYTES(start) <= own);
}

/* Return whether the only argument with a name is `out`. */
static int names_out(PyObject *names)
{
  return PyTuple_GET_SIZE(names) == 1 &&
         PyUnicode_CompareWithASCIIString(PyTuple_GET_ITEM(names, 0), "out") == 0;
}

/* Enter the kernel. Return whether every start has a result at the first attempt. */
static int enter(const many_starts *self, PyArrayObject *packed, int n, const double *start,
                 int n_times, const double *times, double *omega, int8_t *status)
{
  const int n_packed = (int)PyArray_DIM(packed, 0);
  const double *numbers = PyArray_DATA(packed);
  int given_up = 0, raised = 0, others = 0;
  self->address(numbers, &n_packed, &n, start, &n_times, times, &given_up, omega, status, &raised);
  for (int i = 0; i < n; i++) others |= status[i] ^ COMPLETE;
  return others == 0;
}

static PyObject *call(PyObject *object, PyObject *const *given, size_t n_given, PyObject *names)
{
  many_starts *self = (many_starts *)object;
  double time;
  const double *times = &time;
  int n_times = 1;

  if (self->address == NULL) goto slowly;
  if (PyVectorcall_NARGS(n_given) != 2 || !is_plain(given[0], 2)) goto slowly;
  PyArrayObject *start = (PyArrayObject *)given[0];
  npy_intp shape[2] = {PyArray_DIM(start, 0), 3};
  if (PyArray_DIM(start, 1) != 3 || shape[0] < 1 || shape[0] > 1 << 18) goto slowly;
  if (PyFloat_CheckExact(given[1])) {
    time = PyFloat_AS_DOUBLE(given[1]);
  } else if (is_plain(given[1], 1) && PyArray_DIM((PyArrayObject *)given[1], 0) == shape[0]) {
    times = PyArray_DATA((PyArrayObject *)given[1]);
    n_times = (int)shape[0];
  } else {
    goto slowly;
  }
  if (names != NULL && !(names_out(names) && is_place(given[2], start, shape[0]))) goto slowly;

  PyObject *omega = names ? Py_NewRef(given[2]) : PyArray_SimpleNew(2, shape, NPY_DOUBLE);
  PyObject *status = PyArray_SimpleNew(1, shape, NPY_INT8);
  PyObject *both = omega && status ? PyTuple_Pack(2, omega, status) : NULL;
  if (both != NULL) {
    const int n = (int)shape[0];
    const double *numbers = PyArray_DATA(start);
    double *found = PyArray_DATA((PyArrayObject *)omega);
    int8_t *ended = PyArray_DATA((PyArrayObject *)status);
    if (!(self->packed_with_gil != NULL && n <= FEW &&
          enter(self, self->packed_with_gil, n, numbers, n_times, times, found, ended))) {
      PyThreadState *thread = PyEval_SaveThread();
      enter(self, self->packed, n, numbers, n_times, times, found, ended);
      PyEval_RestoreThread(thread);
    }
    if (PyErr_Occurred()) Py_CLEAR(both);
  }
  Py_XDECREF(omega);
  Py_XDECREF(status);
  return both;
slowly:
  return PyObject_Vectorcall(self->slowly, given, n_given, names);
}

/* Return the address behind one of f2py's functions, or NULL for any other callable. */
static void *address_of(PyObject *callable)
{
  PyObject *capsule = PyObject_GetAttrString(callable, "_cpointer");
  if (capsule == NULL) {
    if (PyErr_ExceptionMatches(PyExc_AttributeError)) PyErr_Clear();
    return NULL;
  }
  void *address = PyCapsule_GetPointer(capsule, PyCapsule_GetName(capsule));
  Py_DECREF(capsule);
  return address;
}

static PyArrayObject *own_packed(PyObject *packed)
{
  return (PyArrayObject *)PyArray_FROMANY(packed, NPY_DOUBLE, 1, 1,
                                          NPY_ARRAY_CARRAY | NPY_ARRAY_ENSURECOPY);
}

static PyObject *new_many(PyTypeObject *type, PyObject *args, PyObject *names)
{
  static char *known[] = {"kernel", "packed", "packed_with_gil", "slowly", NULL};
  PyObject *callable, *packed, *packed_with_gil, *slowly;
  if (!PyArg_ParseTupleAndKeywords(args, names, "OOOO", known, &callable, &packed, &packed_with_gil,
                                   &slowly)) {
    return NULL;
  }
  many_starts *self = (many_starts *)type->tp_alloc(type, 0);
  if (self == NULL) return NULL;
  self->vectorcall = call;
  self->callable = Py_NewRef(callable);
  self->slowly = Py_NewRef(slowly);
  self->address = (kernel *)address_of(callable);
  if (!PyErr_Occurred()) self->packed = own_packed(packed);
  if (!PyErr_Occurred() && packed_with_gil != Py_None)
    self->packed_with_gil = own_packed(packed_with_gil);
  if (PyErr_Occurred()) Py_CLEAR(self);
  return (PyObject *)self;
}

static int traverse(PyObject *object, visitproc visit, void *arg)
{
  many_starts *self = (many_starts *)object;
  Py_VISIT(self->callable);
  Py_VISIT(self->slowly);
  return 0;
}

static int clear(PyObject *object)
{
  Py_CLEAR(((many_starts *)object)->slowly);
  return 0;
}

static void dealloc(PyObject *object)
{
  many_starts *self = (many_starts *)object;
  PyObject_GC_UnTrack(object);
  Py_XDECREF(self->callable);
  Py_XDECREF(self->packed);
  Py_XDECREF(self->packed_with_gil);
  Py_XDECREF(self->slowly);
  Py_TYPE(object)->tp_free(object);
}

static PyTypeObject many_starts_type = {
  PyVarObject_HEAD_INIT(NULL, 0)
  .tp_name = "pyharness._many.ManyStarts",
  .tp_doc = "A kernel of many starts with what it is given in every call.",
  .tp_basicsize = sizeof(many_starts),
  .tp_flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_HAVE_GC | Py_TPFLAGS_HAVE_VECTORCALL,
  .tp_new = new_many,
  .tp_call = PyVectorcall_Call,
  .tp_vectorcall_offset = offsetof(many_starts, vectorcall),
  .tp_traverse = traverse,
  .tp_clear = clear,
  .tp_dealloc = dealloc,
};

static struct PyModuleDef module = {
  PyModuleDef_HEAD_INIT,
  .m_name = "pyharness._many",
  .m_size = -1,
};

PyMODINIT_FUNC PyInit__many(void)
{
  import_array();
  if (PyType_Ready(&many_starts_type) < 0) return NULL;
  PyObject *created = PyModule_Create(&module);
  if (created != NULL &&
      PyModule_AddObjectRef(created, "ManyStarts", (PyObject *)&many_starts_type) < 0) {
    Py_CLEAR(created);
  }
  return created;
}
