// SPDX-License-Identifier: Apache-2.0
// What Debian's libstdc++ asks of a C library that is newer than the stubs which cmake/gcc_by_zig.cmake links with.
#include <errno.h>
#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/random.h>
#include <time.h>

// glibc 2.32: whether counts of shared pointers may do without atomics. They may not.
__attribute__((visibility("hidden"))) char __libc_single_threaded = 0;

// glibc 2.36: of std::random_device
__attribute__((visibility("hidden"))) uint32_t arc4random(void) {
  uint32_t value;
  if (getrandom(&value, sizeof value, 0) != (ssize_t)sizeof value) abort();
  return value;
}

// glibc 2.30: of std::condition_variable::wait_for. What is left until then, on the clock that older ones wait by; who
// waits asks his own clock again afterwards.
__attribute__((visibility("hidden"))) int pthread_cond_clockwait(pthread_cond_t* condition, pthread_mutex_t* mutex,
                                                                 clockid_t clock, const struct timespec* end) {
  struct timespec now, until;
  if (clock_gettime(clock, &now) != 0 || clock_gettime(CLOCK_REALTIME, &until) != 0) return EINVAL;
  const long long billion = 1000000000;
  const long long nanoseconds = until.tv_nsec + end->tv_nsec - now.tv_nsec + billion;  // not negative
  until.tv_sec += end->tv_sec - now.tv_sec - 1 + nanoseconds / billion;
  until.tv_nsec = nanoseconds % billion;
  return pthread_cond_timedwait(condition, mutex, &until);
}
