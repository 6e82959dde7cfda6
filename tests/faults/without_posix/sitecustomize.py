"""What tirelog sees of Python on a system that is not POSIX; other packages see what is there."""

import builtins
import os
import signal
import sys
import types
from typing import Any

MODULES = {"fcntl", "resource", "pwd", "grp", "termios", "tty", "pty", "syslog", "posix"}
#: of `os`, beside flags for opening a file
CALLS = """chown chroot confstr ctermid fchdir fchmod fchown fdatasync fork forkpty fpathconf
fstatvfs getegid geteuid getgid getgroups getloadavg getpgid getpgrp getpriority getresgid getresuid
getsid getuid initgroups killpg lchown lockf mkfifo mknod nice openpty pathconf pidfd_open pipe2
posix_fadvise posix_fallocate posix_spawn posix_spawnp pread preadv pwrite pwritev readv
register_at_fork sched_getaffinity sched_setaffinity sched_yield sendfile setegid seteuid setgid
setpgid setpriority setsid setuid statvfs sync sysconf tcgetpgrp uname unshare wait wait3 wait4
waitid writev"""
FLAGS = {"O_APPEND", "O_CREAT", "O_EXCL", "O_RDONLY", "O_RDWR", "O_TRUNC", "O_WRONLY"}
SIGNALS = {"SIGABRT", "SIGFPE", "SIGILL", "SIGINT", "SIGSEGV", "SIGTERM"}
SIGNAL_CALLS = ("alarm", "setitimer", "pthread_sigmask", "pthread_kill", "siginterrupt")


class Without(types.ModuleType):
    """A module without some of its names, and with other values of some."""

    def __init__(self, module: types.ModuleType, hidden: set[str], **other: Any) -> None:
        super().__init__(module.__name__)
        self.__dict__["_seen"] = (module, hidden, other)

    def __getattr__(self, name: str) -> Any:
        module, hidden, other = self.__dict__["_seen"]
        if name in hidden:
            raise AttributeError(f"module {module.__name__!r} has no attribute {name!r}")
        return other[name] if name in other else getattr(module, name)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self.__dict__["_seen"][0], name, value)


def locking(descriptor: int, mode: int, size: int) -> None:
    """What `msvcrt.locking` does for a whole file."""
    lock = real("fcntl")
    lock.flock(descriptor, lock.LOCK_EX | lock.LOCK_NB)


real = builtins.__import__
other = {
    "os": Without(
        os,
        {*CALLS.split(), *(n for n in dir(os) if n.startswith("O_") and n not in FLAGS)},
        name="nt",
    ),
    "signal": Without(
        signal,
        {*SIGNAL_CALLS, *(n for n in dir(signal) if n[:3] == "SIG" and n[3].isalpha())} - SIGNALS,
    ),
    "sys": Without(sys, {"abiflags"}, platform="win32"),
    "msvcrt": types.SimpleNamespace(LK_NBLCK=2, locking=locking),
}


def import_seen(
    name: str, globals: Any = None, locals: Any = None, fromlist: Any = (), level: int = 0
) -> Any:
    """`__import__` that hides what is not there from modules of tirelog, and from no other."""
    if not level and ((globals or {}).get("__name__") or "").startswith("tirelog"):
        if name.partition(".")[0] in MODULES:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        if name in other:
            return other[name]
    return real(name, globals, locals, fromlist, level)


builtins.__import__ = import_seen
