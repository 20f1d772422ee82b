/* Many starts of a prepared solver, from the interpreter into the kernel with no Python between.
   What is not plainly right, or asks for more, goes to a function in Python. */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <stddef.h>

#define NPY_NO_DEPRECATED_API NPY_2_0_API_VERSION
#define NPY_TARGET_VERSION NPY_2_0_API_VERSION
#include <numpy/arrayobject.h>

/* solve_packed_many of api.f90. */
typedef void kernel(const double *packed, const int *n_packed, const int *n, const double *omega0,
                    const int *n_times, const double *times, double *omega, int8_t *status,
                    int *raised);

typedef struct {
  PyObject_HEAD
  vectorcallfunc vectorcall;
  PyObject *callable;    /* the kernel as Python has it: keeps its address */
  kernel *address;
  PyArrayObject *packed; /* read-only */
  PyObject *slowly;      /* what takes any arguments */
  int is_brief;          /* a few starts take less time than others' getting a turn */
} many_starts;

enum { FEW = 16 };

static int is_plain(PyObject *object, int dimensions)
{
  PyArrayObject *array = (PyArrayObject *)object;
  return PyArray_CheckExact(object) && PyArray_NDIM(array) == dimensions &&
         PyArray_TYPE(array) == NPY_DOUBLE && PyArray_ISCARRAY_RO(array);
}

static PyObject *call(PyObject *object, PyObject *const *given, size_t n_given, PyObject *names)
{
  many_starts *self = (many_starts *)object;
  double time;
  const double *times = &time;
  int n_times = 1, raised = 0;

  if (PyVectorcall_NARGS(n_given) != 2 || names != NULL || !is_plain(given[0], 2)) goto slowly;
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

  PyObject *omega = PyArray_SimpleNew(2, shape, NPY_DOUBLE);
  PyObject *status = PyArray_SimpleNew(1, shape, NPY_INT8);
  PyObject *both = omega && status ? PyTuple_Pack(2, omega, status) : NULL;
  if (both != NULL) {
    const int n_packed = (int)PyArray_DIM(self->packed, 0), n = (int)shape[0];
    PyThreadState *thread = self->is_brief && n <= FEW ? NULL : PyEval_SaveThread();
    self->address(PyArray_DATA(self->packed), &n_packed, &n, PyArray_DATA(start), &n_times, times,
                  PyArray_DATA((PyArrayObject *)omega), PyArray_DATA((PyArrayObject *)status),
                  &raised);
    if (thread != NULL) PyEval_RestoreThread(thread);
    if (PyErr_Occurred()) Py_CLEAR(both);
  }
  Py_XDECREF(omega);
  Py_XDECREF(status);
  return both;
slowly:
  return PyObject_Vectorcall(self->slowly, given, n_given, names);
}

static PyObject *new_many(PyTypeObject *type, PyObject *args, PyObject *names)
{
  static char *known[] = {"kernel", "packed", "slowly", "is_brief", NULL};
  PyObject *callable, *packed, *slowly;
  int is_brief;
  if (!PyArg_ParseTupleAndKeywords(args, names, "OOOp", known, &callable, &packed, &slowly,
                                   &is_brief)) {
    return NULL;
  }
  many_starts *self = (many_starts *)type->tp_alloc(type, 0);
  if (self == NULL) return NULL;
  self->vectorcall = call;
  self->callable = Py_NewRef(callable);
  self->slowly = Py_NewRef(slowly);
  self->is_brief = is_brief;
  PyObject *address = PyObject_GetAttrString(callable, "_cpointer");
  if (address != NULL) {
    self->address = (kernel *)PyCapsule_GetPointer(address, PyCapsule_GetName(address));
    Py_DECREF(address);
  }
  if (self->address != NULL) {
    self->packed = (PyArrayObject *)PyArray_FROM_OTF(packed, NPY_DOUBLE,
                                                     NPY_ARRAY_CARRAY | NPY_ARRAY_ENSURECOPY);
  }
  if (self->packed == NULL || PyArray_NDIM(self->packed) != 1) {
    if (!PyErr_Occurred()) PyErr_SetString(PyExc_ValueError, "packed: allowed: one dimension");
    Py_DECREF(self);
    return NULL;
  }
  return (PyObject *)self;
}

static int traverse(PyObject *object, visitproc visit, void *arg)
{
  many_starts *self = (many_starts *)object;
  Py_VISIT(self->callable);
  Py_VISIT(self->packed);
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
