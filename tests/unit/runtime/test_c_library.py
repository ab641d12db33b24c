"""Compilers that are missing or broken, caches that are corrupt, read-only or shared."""

import ctypes
import hashlib
import io
import os
import stat
import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path

import numpy as np
import pytest

import kincompile as kc
from kincompile.errors import KincompileWarning
from kincompile.runtime.native import library as c_library

COMPILE = """
import sys, kincompile as kc
m = kc.Mechanism("tiny")
rod = m.body("rod")
m.add(kc.Revolute("A", m.ground, (0, 0), rod, (1, 0)))
m.add(kc.AbsoluteAngle("motor", rod, kc.t))
for _ in range(int(sys.argv[1])):
    module = kc.compile(m, target="c")
print((module.Phi(module.GUESS, 0.5) + 0.0).tolist())
"""


GCC = "gcc 12, Copyright (C) 2022 Free Software Foundation, Inc."


@pytest.fixture
def cache(monkeypatch, tmp_path, quick_compiler):
    """Return an empty cache, for the compiler of the session."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "kincompile" / "native"


@pytest.fixture
def compiler(monkeypatch, tmp_path, cache):
    """Return a function that puts a script in the compiler's place; it is told what to do."""
    real = os.environ["CC"]

    def replace(script: str) -> None:
        path = tmp_path / "fake-cc"
        path.write_text(
            '#!/bin/sh\n[ "$1" = --version ] && { echo fake 1; exit; }\n'
            'out=; last=; for word do [ "$last" = -o ] && out=$word; last=$word; done\n'
            + textwrap.dedent(script).replace("REAL", real)
        )
        path.chmod(0o755)
        monkeypatch.setenv("CC", str(path))

    return replace


def tiny(name: str = "tiny", angle: float = 1.0) -> kc.Mechanism:
    """Return a mechanism that compiles in no time."""
    m = kc.Mechanism(name)
    rod = m.body("rod")
    m.add(kc.Revolute("A", m.ground, (0, 0), rod, (angle, 0)))
    m.add(kc.AbsoluteAngle("motor", rod, kc.t))
    return m


def assert_right(module):
    np.testing.assert_allclose(module.Phi(np.array([1.0, 2.0, 0.0]), 0.5), [-2.0, -2.0, -0.5])


def assert_intact(folder: Path, libraries: int):
    """Check that a cache holds so many libraries, with their checksums, and nothing else."""
    names = sorted(path.name for path in folder.iterdir())
    found = [path for path in folder.iterdir() if path.suffix == ".so"]
    assert len(found) == libraries
    for path in found:
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        assert path.with_suffix(".sha256").read_text() == digest
    assert len(names) == 2 * libraries


# ---------------------------------------------------------------- the compiler


def test_without_a_compiler_the_error_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(
        kc.UnsupportedError, match=r"needs a C compiler, and there is no .* apt install gcc"
    ) as error:
        kc.compile(tiny(), target="c")
    assert "kc.compile(m)" in str(error.value)


def test_a_compiler_that_is_named_in_vain(monkeypatch, cache):
    monkeypatch.setenv("CC", "no-such-compiler -O0")
    with pytest.raises(kc.UnsupportedError, match="no-such-compiler, which CC names, is not there"):
        kc.compile(tiny(), target="c")


def test_without_a_compiler_numpy_and_the_emitted_text_remain(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    assert "tiny_march" in kc.emit(tiny(), target="c").source
    assert_right(kc.compile(tiny()))


def test_a_compiler_that_fails_is_quoted(compiler, cache):
    compiler('echo "internal compiler error: out of luck" >&2; exit 4')
    with pytest.raises(kc.UnsupportedError, match=r"exit code 4(?s:.*)out of luck"):
        kc.compile(tiny(), target="c")
    assert not cache.exists()


def test_a_compiler_that_fails_without_a_word(compiler):
    compiler("exit 1")
    with pytest.raises(kc.UnsupportedError, match="it says nothing"):
        kc.compile(tiny(), target="c")


def test_a_compiler_that_cannot_tell_its_version(monkeypatch, tmp_path, cache):
    path = tmp_path / "dumb-cc"
    path.write_text("#!/bin/sh\nexit 1\n")
    path.chmod(0o755)
    monkeypatch.setenv("CC", str(path))
    with pytest.raises(kc.UnsupportedError, match="exit code 1"):
        kc.compile(tiny(), target="c")


def test_a_compiler_that_is_no_program(monkeypatch, tmp_path, cache):
    path = tmp_path / "text-cc"
    path.write_bytes(b"\x00\x01")
    path.chmod(0o755)
    monkeypatch.setenv("CC", str(path))
    with pytest.raises(kc.UnsupportedError, match=r"cannot be run: .*; repair or reinstall it"):
        kc.compile(tiny(), target="c")


def test_a_compiler_that_writes_nothing(compiler, cache):
    compiler("exit 0")
    with pytest.raises(kc.UnsupportedError, match="wrote no library"):
        kc.compile(tiny(), target="c")
    assert not cache.exists()


@pytest.mark.parametrize(
    "script", ['echo rubbish > "$out"', ': > "$out"', 'REAL "$@" && truncate -s 700 "$out"']
)
def test_a_compiler_that_writes_rubbish_is_found_out_and_nothing_is_kept(compiler, cache, script):
    compiler(script)
    with pytest.raises(kc.UnsupportedError, match="cannot be loaded"):
        kc.compile(tiny(), target="c")
    assert not cache.exists()


def test_a_compiler_that_compiles_something_else_is_found_out(compiler, cache):
    compiler("""
        sed 's/fingerprint\\[\\] = "./fingerprint[] = "?/' tiny.c > other.c
        set -- $(echo "$@" | sed 's/tiny.c/other.c/'); exec REAL "$@"
    """)
    with pytest.raises(kc.UnsupportedError, match="a library of another mechanism"):
        kc.compile(tiny(), target="c")
    assert not cache.exists()


@pytest.mark.slow
@pytest.mark.parametrize("before", ["", "env "])
def test_options_beside_the_name_have_the_last_word(monkeypatch, compiler, cache, tmp_path, before):
    compiler(f'echo "$@" > {tmp_path}/seen; exec REAL "$@"')
    monkeypatch.setenv("CC", f"{before}{os.environ['CC']} -DEXTRA=1")
    assert_right(kc.compile(tiny(), target="c"))
    seen = (tmp_path / "seen").read_text()
    assert seen.startswith("-O2 -D_WHOLE_REGISTERS ")
    assert " -std=c99 " in seen
    assert " -DEXTRA=1 -fPIC " in seen


@pytest.mark.parametrize(
    ("limit", "level"), [("LARGEST_AT_ONCE", "-O1"), ("LONGEST_OPTIMIZED", "-O0")]
)
def test_large_sources_are_not_optimized_for_minutes(
    monkeypatch, compiler, cache, tmp_path, limit, level
):
    compiler(f'echo "$1" > {tmp_path}/seen; exec REAL "$@"')
    monkeypatch.setattr(c_library, limit, 1000)
    assert_right(kc.compile(tiny(), target="c"))
    assert (tmp_path / "seen").read_text() == f"{level}\n"


@pytest.mark.parametrize(
    ("limits", "level"), [((10**6, 10**6), "-O3"), ((1000, 10**6), "-O2"), ((1000, 1000), "-O1")]
)
def test_that_what_is_built_on_request_is_optimized_by_its_size(
    monkeypatch, compiler, cache, tmp_path, limits, level
):
    module = kc.compile(tiny(), target="c")
    compiler(f'echo "$1" > {tmp_path}/seen; exec REAL "$@"')
    for name, limit in zip(("LARGEST_AT_ONCE", "LARGEST_VECTORIZED"), limits, strict=True):
        monkeypatch.setattr(c_library, name, limit)
    module.kinematics(module.GUESS, 0 * module.GUESS, 0.5)
    assert (tmp_path / "seen").read_text() == f"{level}\n"


@pytest.mark.parametrize(("said", "are_named"), [("clang version 17", False), (GCC, True)])
def test_that_flags_of_passes_are_for_gcc_alone(
    monkeypatch, compiler, cache, tmp_path, said, are_named
):
    log = tmp_path / "log"
    compiler(f'echo "$@" >> {log}\nexec REAL "$@"')
    path = Path(os.environ["CC"])
    path.write_text(path.read_text().replace("fake 1", f"'{said}'"))
    assert_right(kc.compile(tiny(), target="c"))
    assert ("-fno-tree-pre" in log.read_text()) == are_named
    assert "-fno-math-errno" in log.read_text()


# ---------------------------------------------------------------- the cache


@pytest.mark.slow
def test_the_second_time_the_compiler_is_not_needed(compiler, cache, tmp_path):
    compiler(f'echo x >> {tmp_path}/calls; exec REAL "$@"')
    for _ in range(2):
        assert_right(kc.compile(tiny(), target="c"))
    assert (tmp_path / "calls").read_text() == "x\n"
    assert_intact(cache, 1)


@pytest.mark.slow
def test_another_mechanism_has_a_library_of_its_own(cache):
    one, other = kc.compile(tiny(), target="c"), kc.compile(tiny(angle=3.0), target="c")
    q = np.zeros(3)
    assert one.Phi(q, 0.0)[0] == -1.0
    assert other.Phi(q, 0.0)[0] == -3.0
    assert_intact(cache, 2)


@pytest.mark.slow
def test_another_compiler_or_other_flags_build_anew(monkeypatch, cache):
    kc.compile(tiny(), target="c")
    monkeypatch.setenv("CC", f"{os.environ['CC']} -DOTHER=1")
    kc.compile(tiny(), target="c")
    assert_intact(cache, 2)


@pytest.mark.slow
def test_another_processor_builds_anew(monkeypatch, cache):
    kc.compile(tiny(), target="c")
    monkeypatch.setattr(c_library, "_processor", lambda: "flags: something else")
    kc.compile(tiny(), target="c")
    assert_intact(cache, 2)


def damage_nothing(library: Path) -> None:
    """Take the checksum away."""
    library.with_suffix(".sha256").unlink()


def damage_end(library: Path) -> None:
    """Cut the library short, as a full disk would."""
    library.write_bytes(library.read_bytes()[:5000])


def damage_middle(library: Path) -> None:
    """Change one byte."""
    data = bytearray(library.read_bytes())
    data[len(data) // 2] ^= 0xFF
    library.write_bytes(data)


def damage_all(library: Path) -> None:
    """Put something else in its place, with a checksum that is right."""
    library.write_bytes(b"rubbish")
    digest = hashlib.sha256(b"rubbish").hexdigest()
    library.with_suffix(".sha256").write_text(digest)


@pytest.mark.parametrize("damage", [damage_nothing, damage_end, damage_middle, damage_all])
@pytest.mark.slow
def test_what_does_not_agree_with_its_checksum_is_built_again(cache, damage):
    # In processes of their own: a library in use must not be written to.
    assert run_compile() == "[-1.0, 0.0, -0.5]"
    damage(next(cache.glob("*.so")))
    assert run_compile() == "[-1.0, 0.0, -0.5]"
    assert_intact(cache, 1)


@pytest.mark.slow
def test_a_cache_that_cannot_be_made_is_no_obstacle(monkeypatch, cache, tmp_path):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert_right(kc.compile(tiny(), target="c"))
    assert (tmp_path / "file").read_text() == "in the way"


@pytest.mark.slow
def test_a_cache_that_cannot_be_written_to_is_no_obstacle(cache):
    cache.mkdir(parents=True)
    cache.chmod(0o500)
    # Root may write everywhere, unless it gives that right away.
    powerless = ("setpriv", "--bounding-set", "-dac_override") if os.geteuid() == 0 else ()
    assert run_compile(*powerless) == "[-1.0, 0.0, -0.5]"
    assert list(cache.iterdir()) == []


@pytest.mark.slow
def test_a_cache_in_which_a_folder_is_in_the_way_is_no_obstacle(cache):
    kc.compile(tiny(), target="c")
    library = next(cache.glob("*.so"))
    library.unlink()
    library.mkdir()
    assert_right(kc.compile(tiny(), target="c"))


def test_a_temporary_folder_that_cannot_be_written_to_is_named(monkeypatch, cache):
    def refuse(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(tempfile, "TemporaryDirectory", refuse)
    with pytest.raises(kc.UnsupportedError, match=r"No space left on device.*set TMPDIR"):
        kc.compile(tiny(), target="c")


@pytest.mark.slow
def test_nothing_is_left_in_the_temporary_folder(monkeypatch, cache, tmp_path):
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    kc.compile(tiny(), target="c")
    assert list((tmp_path / "temporary").iterdir()) == []


@pytest.mark.parametrize("level", [c_library.QUICK, c_library.FULL, ("-O1",)])
def test_that_tests_build_without_optimization(quick_compiler, level):
    """Else they take twice as long, and all of them pass."""
    command = [os.environ["CC"], *level, "-dM", "-E", "-x", "c", os.devnull]
    macros = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert "__STDC__" in macros
    assert "__OPTIMIZE__" not in macros


def modes(folder: Path) -> set[int]:
    """Return the permissions of a folder and of what is in it."""
    return {stat.S_IMODE(path.lstat().st_mode) for path in (folder, *folder.iterdir())}


@pytest.mark.parametrize("umask", [0, 0o077])
@pytest.mark.slow
def test_the_cache_is_its_users_alone_whatever_the_umask(cache, umask):
    before = os.umask(umask)
    try:
        assert_right(kc.compile(tiny(), target="c"))
    finally:
        os.umask(before)
    assert modes(cache) == {0o700, 0o600}
    assert stat.S_IMODE(cache.parent.stat().st_mode) == 0o700


@pytest.fixture
def loaded(monkeypatch):
    """Return the list of the libraries that are loaded."""
    found = []
    load = ctypes.CDLL

    def record(path):
        found.append(Path(path))
        return load(path)

    monkeypatch.setattr(ctypes, "CDLL", record)
    return found


@pytest.mark.slow
@pytest.mark.parametrize(("ending", "mode"), [(".so", 0o602), (".sha256", 0o620)])
def test_a_file_that_others_may_write_is_built_again(cache, loaded, mode, ending):
    kc.compile(tiny(), target="c")
    library = next(cache.glob("*.so"))
    library.with_suffix(ending).chmod(mode)
    loaded.clear()
    assert_right(kc.compile(tiny(), target="c"))
    assert library not in loaded
    assert modes(cache) == {0o700, 0o600}
    assert_right(kc.compile(tiny(), target="c"))
    assert loaded[-1] == library


@pytest.mark.slow
def test_a_file_that_is_a_link_is_replaced_and_not_loaded(cache, loaded, tmp_path):
    kc.compile(tiny(), target="c")
    library = next(cache.glob("*.so"))
    library.rename(tmp_path / "elsewhere.so")
    before = (tmp_path / "elsewhere.so").read_bytes()
    library.symlink_to(tmp_path / "elsewhere.so")
    loaded.clear()
    assert_right(kc.compile(tiny(), target="c"))
    assert library not in loaded
    assert not library.is_symlink()
    assert (tmp_path / "elsewhere.so").read_bytes() == before


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "fault"),
    [("native", "writable"), ("kincompile", "writable"), ("native", "link"),
     ("kincompile", "another owner")],
)  # fmt: skip
def test_a_folder_that_is_not_the_users_alone_is_not_used(
    cache, loaded, tmp_path, monkeypatch, place, fault
):
    kc.compile(tiny(), target="c")
    folder = cache if place == "native" else cache.parent
    if fault == "writable":
        folder.chmod(0o777)
        reason = "others may write to it"
    elif fault == "link":
        folder.rename(tmp_path / "elsewhere")
        folder.symlink_to(tmp_path / "elsewhere")
        reason = "it is a link"
    else:
        monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
        reason = "it belongs to another user"
    content = {path: path.read_bytes() for path in cache.iterdir()}
    loaded.clear()
    with pytest.warns(KincompileWarning, match=rf"{folder} is not used: {reason}; C code is"):
        assert_right(kc.compile(tiny(), target="c"))
    assert all(cache not in path.parents for path in loaded)
    assert {path: path.read_bytes() for path in cache.iterdir()} == content


def compile_command(times: int = 1) -> list[str]:
    """Return the command of a process that compiles the tiny mechanism."""
    return [sys.executable, "-c", COMPILE, str(times)]


def run_compile(*before: str) -> str:
    """Compile in a process of its own and return what it prints."""
    command = [*before, *compile_command()]
    return subprocess.run(
        command, capture_output=True, text=True, check=True, timeout=120
    ).stdout.strip()


@pytest.mark.slow
def test_processes_that_fill_the_cache_at_once_all_get_it_right(cache, start_process):
    processes = [start_process(compile_command(3)) for _ in range(4)]
    results = [process.communicate(timeout=120) for process in processes]
    assert results == [("[-1.0, 0.0, -0.5]\n", "")] * 4
    assert_intact(cache, 1)


@pytest.mark.slow
def test_a_process_that_is_killed_while_it_builds_leaves_nothing_to_load(
    compiler, cache, start_process
):
    compiler('echo half > "$out"; kill -9 $PPID')
    process = start_process(compile_command())
    assert process.wait(timeout=120) == -9
    assert not cache.exists()
    compiler('exec REAL "$@"')
    assert run_compile() == "[-1.0, 0.0, -0.5]"


class Terminal(io.StringIO):
    """A terminal that keeps what is written."""

    def isatty(self) -> bool:
        return True


@pytest.mark.slow
def test_that_a_slow_compiler_is_mentioned_once_while_it_runs(compiler, monkeypatch):
    """On a terminal alone, and not where the library is there already."""
    monkeypatch.setattr(c_library, "PATIENCE", 0.05)
    compiler('sleep 1\nexec REAL "$@"')
    nowhere, terminal = io.StringIO(), Terminal()
    monkeypatch.setattr(sys, "stderr", nowhere)
    kc.compile(tiny("unseen"), target="c")
    assert nowhere.getvalue() == ""
    monkeypatch.setattr(sys, "stderr", terminal)
    for _ in range(2):
        assert_right(kc.compile(tiny("slow"), target="c"))
    (line,) = terminal.getvalue().splitlines()
    assert line.startswith("Compiling slow.c by ")
    assert line.endswith("fake-cc ...")


# ---------------------------------------------------------------- many parameter sets

TWO_LENGTHS = {"length": [1.0, 2.0]}


def rod() -> kc.Mechanism:
    """Return a tiny mechanism with a parameter."""
    m = kc.Mechanism("rod")
    rod, length = m.body("rod"), m.parameter("length", 1.0)
    m.add(kc.Revolute("A", m.ground, (0, 0), rod, (length, 0)))
    m.add(kc.AbsoluteAngle("motor", rod, kc.t))
    return m


def test_that_what_many_sets_need_is_compiled_on_request(compiler, cache, tmp_path):
    """One motion, steps and points leave it out; the second library leaves these out."""
    compiler(f'echo x >> {tmp_path}/calls; exec REAL "$@"')
    module = kc.compile(rod(), target="c")
    assert kc.solve(module, [0.0, 0.1]).success
    kc.stepper(module)(0.1)
    assert (tmp_path / "calls").read_text() == "x\n"
    (first,) = cache.glob("*.so")
    for _ in range(2):
        solution = kc.solve(module, [0.0, 0.1], TWO_LENGTHS)
        np.testing.assert_allclose(solution["x_rod"][:, 0], [-1.0, -2.0])
    assert (tmp_path / "calls").read_text() == "x\n" * 2
    (second,) = set(cache.glob("*.so")) - {first}
    of_one = ("evaluate", "solve", "march", "set_out", "go_on", "stepper_size")
    of_sets = [f"{x}_variants" for x in ("march", "follow", "attempt", "mirror", "lead")]
    for path, present, absent in ((first, of_one, of_sets), (second, of_sets, of_one)):
        library = ctypes.CDLL(str(path))
        assert all(hasattr(library, f"rod_{x}") for x in present)
        assert not any(hasattr(library, f"rod_{x}") for x in absent)
    assert_intact(cache, 2)


def test_a_compiler_that_is_missing_when_sets_come_is_named(monkeypatch, compiler, cache):
    """What one motion needs goes on, and so do sets once there is a compiler again."""
    module = kc.compile(rod(), target="c")
    with monkeypatch.context() as patch:
        patch.setenv("CC", "no-such-compiler")
        with pytest.raises(kc.UnsupportedError, match="no-such-compiler, which CC names, is not"):
            kc.solve(module, [0.0, 0.1], TWO_LENGTHS)
    compiler('echo "out of luck" >&2; exit 4')
    with pytest.raises(kc.UnsupportedError, match=r"exit code 4(?s:.*)out of luck"):
        kc.solve(module, [0.0, 0.1], TWO_LENGTHS)
    assert kc.solve(module, [0.0, 0.1]).success
    compiler('exec REAL "$@"')
    assert kc.solve(module, [0.0, 0.1], TWO_LENGTHS).success
