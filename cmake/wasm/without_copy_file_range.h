// SPDX-License-Identifier: Apache-2.0
// libc++ copies files with it, and WASI does not have it.
#include <errno.h>
#include <sys/types.h>

static inline ssize_t copy_file_range(int, off_t*, int, off_t*, size_t, unsigned) {
  errno = EINVAL;
  return -1;
}
