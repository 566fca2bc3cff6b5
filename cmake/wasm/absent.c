// SPDX-License-Identifier: Apache-2.0
// Calls of POSIX that WASI does not have.
#include <errno.h>
#include <string.h>
#include <sys/types.h>

int madvise(void *from, size_t bytes, int advice) {
  (void)from, (void)bytes, (void)advice;
  return 0;
}

int gethostname(char *name, size_t size) {
  strncpy(name, "wasm", size);
  return 0;
}

// Threads do not end here, so nothing is left to destroy.
int __cxa_thread_atexit(void (*destroy)(void *), void *object, void *module) {
  (void)destroy, (void)object, (void)module;
  return 0;
}
