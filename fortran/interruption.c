/* Whether the user has interrupted (Ctrl-C): asked by the kernels from time to time, by the work
   done. Handlers of signals run here; what they raise stays set, and f2py's wrapper, as any door
   must, looks for it when the kernel has returned. */
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#if defined(__linux__)
#include <sys/syscall.h>
#include <unistd.h>
#elif defined(__APPLE__)
#include <pthread.h>
#endif

/* Python gives signals to its main thread alone: others need not wait for its lock. */
static int may_be_main_thread(void)
{
#if defined(__linux__)
  return (long)getpid() == syscall(SYS_gettid);
#elif defined(__APPLE__)
  return pthread_main_np();
#else
  return 1;
#endif
}

/* What a thread that is not Python's main one looks at instead: the one that waits for it sets it. */
static _Thread_local const volatile int *given_up;

/* Let this thread look at a number, which is not 0 when its work is not wanted any more; or, given
   nothing, at none. */
void watch(const int *number) { given_up = number; }

int interrupt_raised(void)
{
  if (given_up != NULL && *given_up != 0)
    return 1;
  if (!may_be_main_thread() || !Py_IsInitialized())
    return 0;
  PyGILState_STATE held = PyGILState_Ensure();
  int raised = PyErr_CheckSignals() != 0;
  PyGILState_Release(held);
  return raised;
}
