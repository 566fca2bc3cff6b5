# SPDX-License-Identifier: Apache-2.0
"""What can go wrong, each with one sentence: what is wrong, where, and what to do."""


class Error(Exception):
    """The base of every exception that pointfair raises."""


class UsageError(Error, ValueError):
    """An argument is out of range, has the wrong shape or type, or contradicts another one."""


class FileError(Error, OSError):
    """A file cannot be read, written or understood."""


class DeviceError(Error, RuntimeError):
    """The requested device is missing or cannot be used."""


class OutOfMemory(Error, MemoryError):
    """The host or the device has too little memory."""


for _class in (Error, UsageError, FileError, DeviceError, OutOfMemory):
    _class.__module__ = "pointfair"
