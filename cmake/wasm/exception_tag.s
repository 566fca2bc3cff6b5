# SPDX-License-Identifier: Apache-2.0
# What every exception of C++ is thrown as; the compiler expects it from the runtime library.
.tagtype __cpp_exception i32
.globl __cpp_exception
__cpp_exception:
