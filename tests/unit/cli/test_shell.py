"""What holds for every command: exceptions, streams, imports, the progress bar."""

import io
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import kincompile as kc
from kincompile.cli import progress as cli


def test_that_a_bug_is_a_message_that_asks_for_a_report(kincompile, pendulum, monkeypatch):
    def broken(model):
        raise ZeroDivisionError("by chance")

    monkeypatch.setattr(kc, "inspect", broken, raising=False)
    done = kincompile("inspect", pendulum)
    assert (done.exit_code, done.stdout) == (2, "")
    assert "Error: ZeroDivisionError: by chance. This is a bug in kincompile" in done.stderr
    assert "KINCOMPILE_TRACEBACK=1" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(("value", "wanted"), [("1", True), ("0", False), ("", False)])
def test_that_the_traceback_is_shown_where_it_is_wanted(
    kincompile, pendulum, monkeypatch, value, wanted
):
    pendulum.write_text("1 / 0")
    monkeypatch.setenv("KINCOMPILE_TRACEBACK", value)
    done = kincompile("inspect", pendulum)
    assert done.exit_code == 2
    assert ("Traceback" in done.stderr) is wanted
    assert done.stderr.endswith(f"Error: {pendulum}, line 1: ZeroDivisionError: division by zero\n")


def test_that_too_many_points_for_the_memory_are_a_message(kincompile, pendulum, monkeypatch):
    def greedy(*arguments, **options):
        raise MemoryError

    monkeypatch.setattr(kc, "solve", greedy, raising=False)
    done = kincompile("run", pendulum)
    assert (done.exit_code, "not enough memory; ask for fewer points" in done.stderr) == (2, True)


# A shell starts background jobs with SIGINT ignored, and its children inherit that.
INTERRUPTIBLE = (
    "import runpy, signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    "runpy.run_module('kincompile', run_name='__main__')"
)


@pytest.mark.parametrize("inherited", [signal.SIG_DFL, signal.SIG_IGN], ids=["shell", "background"])
def test_that_ctrl_c_ends_a_process_without_a_traceback(tmp_path, start_process, inherited):
    (tmp_path / "endless.py").write_text(
        "import sys, time\n"
        "print('running', file=sys.stderr, flush=True)\n"
        "while True:\n"
        "    time.sleep(60)\n"
    )
    before = signal.signal(signal.SIGINT, inherited)
    try:
        running = start_process(
            [sys.executable, "-c", INTERRUPTIBLE, "run", str(tmp_path / "endless.py")]
        )
    finally:
        signal.signal(signal.SIGINT, before)
    assert running.stderr.readline() == "running\n"
    running.send_signal(signal.SIGINT)
    stdout, stderr = running.communicate(timeout=60)
    assert (running.returncode, stdout, stderr) == (130, "", "Interrupted.\n")


def test_that_a_reader_who_has_seen_enough_is_no_error(pendulum, start_process):
    running = start_process([sys.executable, "-m", "kincompile", "inspect", str(pendulum)])
    running.stdout.close()
    assert running.stderr.read() == ""
    assert running.wait(timeout=60) == -signal.SIGPIPE


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_that_a_full_stdout_is_a_message(process, pendulum):
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        done = process("inspect", pendulum, stdout=full)
    assert done.returncode == 2
    assert done.stderr == "Error: cannot write to stdout: No space left on device\n"


@pytest.mark.skipif(not Path("/dev/stdout").exists(), reason="needs stdout as a device")
def test_that_a_device_is_written_to_and_not_replaced(process, pendulum):
    done = process("compile", pendulum, "-o", "/dev/stdout")
    assert done.stdout == kc.emit(kc.read_model(pendulum)).source


@pytest.mark.slow
def test_that_units_beyond_ascii_are_shown_on_any_terminal(process, pendulum, monkeypatch):
    pendulum.write_text(pendulum.read_text().replace('unit="m"', 'unit="µm"'), encoding="utf-8")
    monkeypatch.setenv("PYTHONIOENCODING", "ascii")
    done = process("inspect", pendulum, encoding="utf-8")
    assert (done.returncode, done.stderr) == (0, "")
    assert "µm" in done.stdout


@pytest.mark.slow
def test_that_what_a_model_prints_is_no_data(process, pendulum):
    pendulum.write_text(pendulum.read_text() + "\nprint('hello from the model')\n")
    done = process("compile", pendulum, "-o", "-")
    assert done.stderr == "hello from the model\n"
    assert done.stdout.startswith('"""')


def loaded_by(*arguments):
    """Return the modules that the command line loads."""
    program = (
        "import sys\n"
        "from kincompile.cli import main\n"
        "try:\n"
        "    main()\n"
        "finally:\n"
        "    print(*sys.modules, file=sys.stderr)"
    )
    command = [sys.executable, "-c", program, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return set(done.stderr.split())


@pytest.mark.parametrize("option", ["--help", "--version"])
def test_that_help_and_version_load_neither_sympy_nor_rich(option):
    assert loaded_by(option) & {"sympy", "scipy", "rich"} == set()


@pytest.mark.slow
def test_that_a_command_in_a_pipe_does_not_load_rich(pendulum):
    assert loaded_by("run", str(pendulum)) & {"sympy", "rich"} == {"sympy"}


def test_that_the_script_and_the_module_are_the_same_command(process):
    script = Path(sys.executable).with_name("kincompile")
    done = subprocess.run([script, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == process("--version").stdout == f"kincompile {kc.__version__}\n"


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        """Say so."""
        return True


def bar_on_a_terminal(monkeypatch, patience):
    """Let a progress bar run over four points, and return what a terminal showed."""
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(cli, "PATIENCE", patience)
    with cli.progress_bar() as progress:
        assert progress is not None
        for done in range(1, 5):
            progress(done, 4)
    return terminal.getvalue()


def test_that_long_work_shows_a_bar_on_a_terminal(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    assert "solving" in bar_on_a_terminal(monkeypatch, patience=0)


def test_that_short_work_shows_nothing(monkeypatch):
    assert bar_on_a_terminal(monkeypatch, patience=3600) == ""


def test_that_no_bar_is_made_where_nobody_looks(monkeypatch):
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with cli.progress_bar() as progress:
        assert progress is None
