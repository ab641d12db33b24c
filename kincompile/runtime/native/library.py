"""A C library built with the machine's own compiler, once, and kept in the user's cache.

A library is named by a digest of all that decides its bytes: source, flags, compiler and processor.
Beside it lies the digest of its own bytes. That finds damage; it does not protect from anyone who
can write there. So the cache is its user's alone: folders have mode 0700 and files 0600, whatever
the umask; a link, and what another user owns or may write to, is not used.

A library is built in a folder of its own and moved into place in one step once it was loaded, and
what does not agree with its digest is never loaded but built again: so neither a crash nor a second
process that builds the same does any harm.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import shlex
import shutil
import stat
import subprocess
import sys
import tempfile
import warnings
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from threading import Timer
from typing import TYPE_CHECKING, NamedTuple

from kincompile.errors import InputError, KincompileWarning, UnsupportedError
from kincompile.names import escaped
from kincompile.writing import write_atomically

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

COMPILERS = ("cc", "gcc", "clang")
"""Compilers that are looked for where the environment variable CC names none."""

FLAGS = (
    "-std=c99", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=fast",
)  # fmt: skip
"""None of these changes what a program may assume of floating-point numbers, NaN included."""

WIDEST, SINCE = ("-mprefer-vector-width=512", "-D_WIDEST_REGISTERS"), "avx512_vbmi2"
"""Flags for registers of eight numbers, of which compilers use half by themselves, and a mark of
processors that run them at full speed (Intel since 2019, AMD since 2022): motions take 0.8 of the
time."""

OWN = ("-D_WITHOUT_START",)
"""Flags of the runtime's libraries: it has a start of its own."""

QUICK = (
    "-O2", "-D_WHOLE_REGISTERS", "-ftree-vectorize", "-fvect-cost-model", "-funswitch-loops",
    "-fno-tree-pre", "-fno-tree-vrp", "-fno-tree-dominator-opts", "-fno-thread-jumps",
    "-fno-rerun-cse-after-loop", "-fno-cse-follow-jumps", "-fno-code-hoisting",
    "-fno-predictive-commoning",
)  # fmt: skip
"""Loops over points take several at once, as with -O3, for which gcc takes up to twice as long.
Passes that look for what is computed twice are left out: emitted code has none of it, and gcc takes
an eighth less. Motions are solved as fast, and batches too."""

FULL = ("-O3", "-D_WHOLE_REGISTERS", "-fno-ipa-cp-clone", "-fno-inline-functions")
"""In full, but for copies of functions that the code does not ask for: a loop over points is then
compiled once. Without the last three gcc takes three times as long for the same speed."""


class Part(NamedTuple):
    """A library of a source: the flags that optimize it, and those that leave the rest out."""

    level: tuple[str, ...]
    only: tuple[str, ...]


ONE = Part(QUICK, ("-D_WITHOUT_SETS", "-D_WITHOUT_KINEMATICS"))
"""What one motion and the quantities of given points need: it is built at once."""

KINEMATICS = Part(FULL, ("-D_WITHOUT_SETS", "-D_ONLY_KINEMATICS"))
"""All quantities of given points in one go, which no motion needs: built on request."""

SETS = Part(FULL, ("-D_WITHOUT_ONE",))
"""What many parameter sets need: built on request."""

LARGEST_AT_ONCE, LARGEST_VECTORIZED = 302_000, 1_200_000
"""Characters of source up to which loops over points take several at once: in the library that a
first motion waits for, and in those that are built on request. An angle's cosine and sine, which
are written in line, count as ANGLE. gcc combines instructions in time that grows with the square of
a function's length: it takes 1.4 s for a Delta robot, and half of that where points are taken one
by one, at half the speed; for a platform of 91 coordinates 10 s and 5 s. CC may ask for more."""
ANGLE = 3_000

LONGEST_OPTIMIZED = 400_000
"""Characters of one function up to which it is optimized at all: gcc's choice of registers takes 11
s for 330,000, and ten minutes for the 1,600,000 of second derivatives of an ankle with four bodies
in its legs, which take 2 s as they are, and then no longer a point than NumPy does."""

PATIENCE = 1.0
"""Seconds after which a compiler at work is mentioned."""

TRIAL = "import ctypes, sys; ctypes.CDLL(sys.argv[1])"

MOST_LINES = 20
"""Lines of a compiler's messages that are passed on."""

ALTERNATIVE = "or use the NumPy target, which needs no compiler: kc.compile(m)"
REPAIR = f"repair or reinstall it, name another by the environment variable CC, {ALTERNATIVE}"


def library(name: str, files: Mapping[str, str], fingerprint: str, part: Part = ONE) -> ctypes.CDLL:
    """Return a library of emitted C code, a part of it, from the cache or newly built.

    Of the files, text by name, the source comes first; the fingerprint is what the library must say
    of itself. An `UnsupportedError` says what is wrong with the compiler.
    """
    source = next(iter(files.values()))
    compiler = _compiler()
    level = _understood(compiler[0], _level(source, part.level))
    command = _command(compiler, *level, *FLAGS, *OWN, *part.only, *_machine_flags())
    digest = hashlib.sha256()
    for text in (*command, _version(command[0]), _processor(), *files, *files.values()):
        digest.update(text.encode() + b"\0")
    folder = _own_folder(_cache_folder())
    kept = None if folder is None else folder / f"{name}-{digest.hexdigest()[:32]}.so"
    if kept is not None and _is_intact(kept):
        # One that cannot be loaded, from a folder without leave to run code, is built elsewhere.
        with suppress(UnsupportedError):
            return _loaded(kept, name, fingerprint)
    try:
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as temporary:
            built = _built(command, Path(temporary), files)
            _try(built, name)
            loaded = _loaded(built, name, fingerprint)
            if kept is not None:
                _keep(built.read_bytes(), kept)
            return loaded
    except OSError as error:
        raise UnsupportedError(
            f"the C code of {name} cannot be built in the temporary folder: {error.strerror}. Free "
            f"some space or set TMPDIR to another folder, {ALTERNATIVE}."
        ) from error


def shared_library(files: Mapping[str, str]) -> bytes | None:
    """Return the library of emitted C code for every processor of this machine's kind.

    It shows what the code declares to be shown. None, with a warning, where there is no compiler.
    """
    try:
        compiler = _compiler()
    except UnsupportedError:
        warnings.warn(
            "the archive has its sources alone, which whoever imports it must compile: no C "
            "compiler was found. Install one, or name one by the environment variable CC.",
            KincompileWarning,
            stacklevel=3,
        )
        return None
    # Points come one by one: loops over many of them, which -O3 is for, gain nothing.
    level = _level(max(files.values(), key=len), ("-O1",))
    command = _command(compiler, *level, *FLAGS, "-fvisibility=hidden")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as temporary:
        built = _built(command, Path(temporary), files)
        _try(built, next(iter(files)))
        return built.read_bytes()


def _level(source: str, wanted: tuple[str, ...]) -> tuple[str, ...]:
    """Return the flags that say how far code is optimized: as far as it does not take a minute."""
    if max(map(len, source.split("\n}\n"))) > LONGEST_OPTIMIZED:
        return ("-O0",)
    size = len(source) + ANGLE * source.count("cos_sin(")
    if size <= LARGEST_AT_ONCE:
        return wanted
    return QUICK if wanted == FULL and size <= LARGEST_VECTORIZED else ("-O1",)


def _command(compiler: tuple[str, ...], *flags: str) -> tuple[str, ...]:
    """Return a compiler with flags; options that CC names come last, and have the last word."""
    first = next((k for k, x in enumerate(compiler) if x.startswith("-")), len(compiler))
    return (*compiler[:first], *flags, *compiler[first:])


def _compiler() -> tuple[str, ...]:
    """Return the compiler: what CC says, which may have arguments, or the first that is there."""
    given = shlex.split(os.environ.get("CC", ""))
    for wanted in [given[0]] if given else COMPILERS:
        found = shutil.which(wanted)
        if found:
            return (found, *given[1:])
    sought = (
        f"{given[0]}, which CC names, is not there" if given else "there is no cc, gcc or clang"
    )
    raise UnsupportedError(
        f"the C target needs a C compiler, and {sought}. Install one (Debian, Ubuntu: apt install "
        "gcc; Fedora: dnf install gcc; macOS: xcode-select --install) or name one by the "
        f"environment variable CC, {ALTERNATIVE}."
    )


@cache
def _version(compiler: str) -> str:
    """Return what a compiler says of itself."""
    return _run((compiler, "--version"), None).stdout


def _understood(compiler: str, flags: tuple[str, ...]) -> tuple[str, ...]:
    """Return the flags that a compiler knows: those that name passes are gcc's own."""
    if "Free Software Foundation" in _version(compiler):
        return flags
    return tuple(flag for flag in flags if not flag.startswith("-f"))


def _machine_flags() -> tuple[str, ...]:
    """Return the flags for this very processor, where it is known which one that is."""
    known = platform.machine() in ("x86_64", "AMD64", "aarch64") and _processor()
    if not known:
        return ()
    return ("-march=native", *(WIDEST if SINCE in known else ()))


@cache
def _processor() -> str:
    """Return what tells this processor from others, so that they can share a home folder."""
    with suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        wanted = ("model name", "flags", "Features", "CPU part")
        return "\n".join(dict.fromkeys(line for line in lines if line.startswith(wanted)))
    return ""


def _cache_folder() -> Path:
    # Only who builds needs to know where; the import costs more than all the other steps.
    from platformdirs import user_cache_path

    return user_cache_path("kincompile") / "native"


def _own_folder(folder: Path) -> Path | None:
    """Return the cache if it is its user's alone, None where it is not; it may not exist yet."""
    for path in (folder.parent, folder):
        if reason := _distrust(path, stat.S_ISDIR):
            warnings.warn(
                f"the cache of compiled libraries {escaped(path)} is not used: {reason}; C code is "
                "built each time. Remove it, or make it a folder that only you can write "
                "to (chmod 700)",
                KincompileWarning,
                stacklevel=2,
            )
            return None
    return folder


def _distrust(path: Path, is_kind: Callable[[int], bool]) -> str:
    """Return why a file or folder of the cache could be the work of another user, "" if not."""
    try:
        found = path.lstat()
    except OSError:  # it is not there, or cannot be reached: then nothing is loaded from it
        return ""
    if stat.S_ISLNK(found.st_mode):
        return "it is a link"
    if not is_kind(found.st_mode):
        return ""
    if hasattr(os, "geteuid") and found.st_uid != os.geteuid():
        return "it belongs to another user"
    return "others may write to it" if found.st_mode & 0o022 else ""


def _is_intact(path: Path) -> bool:
    """Return whether a library is there, is the user's own and has the bytes it was kept with."""
    if any(_distrust(item, stat.S_ISREG) for item in (path, _checksum(path))):
        return False
    with suppress(OSError):
        return _checksum(path).read_text(encoding="ascii") == _digest(path.read_bytes())
    return False


def _keep(library: bytes, path: Path) -> None:
    """Put a library into the cache."""
    # A cache that cannot be written to, or is full, is no obstacle.
    with suppress(OSError, InputError):
        for folder in reversed(path.parents):
            if not folder.exists():
                folder.mkdir(exist_ok=True)
                folder.chmod(0o700)
        write_atomically(path, library, is_private=True)
        write_atomically(_checksum(path), _digest(library), is_private=True)


def _checksum(path: Path) -> Path:
    return path.with_suffix(".sha256")


def _digest(library: bytes) -> str:
    return hashlib.sha256(library).hexdigest()


def _built(command: tuple[str, ...], folder: Path, files: Mapping[str, str]) -> Path:
    """Compile emitted code in a folder and return the library."""
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    sources = [name for name in files if name.endswith(".c")]
    built = folder / "library.so"
    with _said(f"Compiling {sources[0]} by {command[0]} ..."):
        _run((*command, "-fPIC", "-shared", *sources, "-o", built.name, "-lm"), folder)
    if not built.is_file():
        raise UnsupportedError(f"the C compiler {command[0]} wrote no library; {REPAIR}.")
    return built


@contextmanager
def _said(words: str) -> Iterator[None]:
    """Say what is done where it lasts and someone is at a terminal, as a progress bar does."""
    timer = Timer(PATIENCE, lambda: sys.stderr.write(f"{words}\n"))
    if sys.stderr is not None and sys.stderr.isatty():
        timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _run(command: tuple[str, ...], folder: Path | None) -> subprocess.CompletedProcess[str]:
    """Run the compiler, or say how it failed."""
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, errors="replace", check=False
        )
    except OSError as error:
        raise UnsupportedError(
            f"the C compiler {command[0]} cannot be run: {error.strerror}; {REPAIR}."
        ) from error
    if done.returncode != 0:
        said = "\n".join(done.stderr.splitlines()[:MOST_LINES]) or "it says nothing"
        raise UnsupportedError(
            f"the C compiler failed, with exit code {done.returncode}:\n  {shlex.join(command)}\n"
            f"{said}\nIf it does so with every program, {REPAIR}."
        )
    return done


def _try(path: Path, name: str) -> None:
    """Load a new library in a process of its own: one that was cut short takes the process down."""
    command = (sys.executable, "-I", "-S", "-c", TRIAL, str(path))
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    if done.returncode != 0:
        said = (done.stderr.splitlines() or [f"exit code {done.returncode}"])[-1]
        raise UnsupportedError(
            f"the library that the C compiler made of {name} cannot be loaded: {said}; {REPAIR}."
        )


def _loaded(path: Path, name: str, fingerprint: str) -> ctypes.CDLL:
    """Load a library and see that it is of this mechanism."""
    try:
        library = ctypes.CDLL(str(path))
        found = ctypes.c_char_p(
            ctypes.addressof(ctypes.c_char.in_dll(library, f"{name}_fingerprint"))
        )
    except (OSError, ValueError) as error:
        raise UnsupportedError(
            f"the library that the C compiler made of {name} cannot be loaded: {error}; {REPAIR}."
        ) from error
    if found.value != fingerprint.encode():
        raise UnsupportedError(f"the C compiler made a library of another mechanism; {REPAIR}.")
    return library
