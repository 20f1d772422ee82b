/* The poll for user interrupts (Ctrl-C). Kernels call it after a fixed amount of work. It runs
   Python's pending signal handlers. An exception that a handler raises stays set. f2py's wrapper,
   like every other entry point, must check for it when the kernel has returned. */
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#if defined(__linux__)
#include <sys/syscall.h>
#include <unistd.h>
#elif defined(__APPLE__)
#include <pthread.h>
#endif

/* Python runs signal handlers in its main thread only; other threads need not wait for the GIL. */
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

/* A number that this thread also checks, or NULL. It is for threads other than Python's main
   thread; the thread that waits for this one sets it. */
static _Thread_local const volatile int *given_up;

/* Make this thread check a number, which is not 0 when the result is no longer wanted; NULL ends
   the checks. */
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
