"""`kincompile view MODEL --watch`: a page that follows its model, on this machine alone."""

import http.client
import json
import re
import signal
import socket
import subprocess
import sys
from typing import Any

import pytest

from kincompile.cli.serve import HOST, PORT, LivePage, served
from kincompile.cli.watched import _Reads, stamp

HELPER = "LENGTH = {}\n"
MODEL = """
import kincompile as kc
from helper import LENGTH

mechanism = kc.Mechanism("pendulum", end=2.0, points=5)
length = mechanism.parameter("length", LENGTH, unit="m")
bob = mechanism.body("bob", guess=(1, 0, 0.5))
mechanism.add(kc.Revolute("pin", bob, (-length, 0), mechanism.ground, (0, 0)))
mechanism.add(kc.AbsoluteAngle("motor", bob, 0.5 + 2 * kc.t))
"""
SCRIPT = re.compile(r'<script data-version="(\w+)">\n.*?</script>\n', re.DOTALL)


class Browser:
    """Asks a server for pages, and listens to its events."""

    def __init__(self, address):
        (self.port,) = map(int, re.findall(r":(\d+)/", address))
        self.events = None

    def ask(self, path, host=None, method="GET"):
        connection = http.client.HTTPConnection(HOST, self.port, timeout=120)
        headers = {} if host is None else {"Host": host}
        connection.request(method, path, headers=headers)
        return connection.getresponse()

    def page(self):
        """Return the version of the page, and the page without the script that follows it."""
        text = self.ask("/").read().decode()
        (version,) = SCRIPT.findall(text)
        return version, SCRIPT.sub("", text)

    def listen(self):
        """Return the next state that is told."""
        if self.events is None:
            self.events = self.ask("/events")
        while True:
            line = self.events.fp.readline().decode()
            assert line, "the server has gone"
            if line.startswith("data: "):
                return json.loads(line.removeprefix("data: "))

    def listen_for(self, wanted):
        """Return the first state for which a function is true."""
        while not wanted(state := self.listen()):
            pass
        return state


@pytest.fixture
def model(tmp_path):
    (tmp_path / "helper.py").write_text(HELPER.format("1.0"), encoding="utf-8")
    path = tmp_path / "model.py"
    path.write_text(MODEL, encoding="utf-8")
    return path


@pytest.fixture
def watching():
    """Return a function that starts the command: its process and its first line."""
    pytest.importorskip("watchfiles", reason="watchfiles is not installed")
    started = []

    def start(*arguments):
        command = [sys.executable, "-m", "kincompile", "view", *map(str, arguments), "--watch"]
        process: Any = subprocess.Popen(
            command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        started.append(process)
        return process, process.stderr.readline()

    yield start
    for process in started:
        process.kill()
        process.communicate()


@pytest.mark.slow
def test_that_the_page_follows_the_model_and_what_it_imports(watching, model, process, tmp_path):
    watcher, line = watching(model, "--end", "1", "--points", "3", "--deg")
    assert line.startswith(f"{model} is shown at http://127.0.0.1:")
    browser = Browser(line)
    first = browser.listen_for(lambda state: "status" in browser.page()[1])
    written = tmp_path / "written" / "page.html"
    written.parent.mkdir()
    assert process("view", model, "-o", written, "--end", 1, "--points", 3, "--deg").returncode == 0
    version, html = browser.page()
    assert version == first["version"]
    assert html == written.read_text(encoding="utf-8")
    assert '{"name":"length","value":1.0' in html

    helper = tmp_path / "helper.py"
    helper.write_text("LENGTH = <b>\n", encoding="utf-8")
    failed = browser.listen_for(lambda state: state["error"])
    command = process("view", model, "-o", written)
    assert command.returncode == 2
    assert failed == {"version": version, "error": command.stderr.strip()}
    assert browser.page() == (version, html)  # the last good one stays

    helper.write_text(HELPER.format("2.0"), encoding="utf-8")
    mended = browser.listen_for(lambda state: not state["error"])
    assert mended["version"] != version
    assert '{"name":"length","value":2.0' in browser.page()[1]

    # A model that does not end is ended when it is saved again.
    model.write_text(f"{MODEL}\nopen({str(tmp_path / 'began')!r}, 'w').close()\nwhile True: pass\n")
    while not (tmp_path / "began").exists():
        assert watcher.poll() is None
    model.write_text(MODEL.replace('"pendulum"', '"clock"'), encoding="utf-8")
    browser.listen()
    assert "<title>clock</title>" in browser.page()[1]

    watcher.send_signal(signal.SIGINT)
    _, said = watcher.communicate(timeout=60)
    assert watcher.returncode == 0
    assert said.splitlines() == [
        "The page is new.",
        command.stderr.strip(),
        *2 * ["The page is new."],
    ]


def test_that_only_this_machine_gets_the_page_and_nothing_else():
    page = LivePage("<model>.py")
    with served(page) as address:
        browser = Browser(address)
        own = [f"127.0.0.1:{browser.port}", f"localhost:{browser.port}"]
        assert [browser.ask("/", host).status for host in own] == [200, 200]
        others = [
            "example.org",
            f"example.org:{browser.port}",
            "127.0.0.1",
            f"{own[0]}.example.org",
        ]
        assert {browser.ask("/", host).status for host in others} == {403}
        assert {browser.ask("/events", host).status for host in others} == {403}
        paths = ["/index.html", "/..", "/../etc/passwd", "//x", "/?x", "/events/"]
        assert {browser.ask(path).status for path in paths} == {404}
        assert {browser.ask("/", method=word).status for word in ("POST", "PUT", "HEAD")} == {501}
        answer = browser.ask("/")
        assert answer.getheader("Cache-Control") == "no-store"
        assert "<title>&lt;model&gt;.py</title>" in answer.read().decode()


def test_that_another_port_is_taken_where_one_is_taken():
    with socket.socket() as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            other.bind((HOST, PORT))
            other.listen()
        except OSError:
            pass  # somebody else has it: as well
        with served(LivePage("model.py")) as address:
            browser = Browser(address)
            assert browser.port != PORT
            assert browser.ask("/").status == 200


def test_that_an_error_is_told_once_and_goes_with_the_next_page():
    page = LivePage("model.py")
    with served(page) as address:
        browser = Browser(address)
        before = browser.listen()
        page.fail("line 1\nline 2 <script>")
        assert browser.listen() == before | {"error": "line 1\nline 2 <script>"}
        page.show("<html><body>the page</body></html>")
        after = browser.listen()
        assert after == {"version": browser.page()[0], "error": ""}
        assert after["version"] != before["version"]
        assert browser.page()[1] == "<html><body>the page</body></html>"


def test_that_the_files_of_a_model_are_known(tmp_path):
    read, made, table = tmp_path / "other.py", tmp_path / "made.csv", tmp_path / "table.csv"
    for path in (read, made, table):
        path.write_text("x = 1\n", encoding="utf-8")
    reads = _Reads(str(tmp_path))
    other = str(tmp_path.parent / "elsewhere.csv")
    for path, mode, flags in (
        (str(read), "r", 0), (str(table), None, 0), (json.__file__, "rb", 0), (3, "r", 0),
        (str(tmp_path / "gone.py"), "rb", 0), (other, "r", 0),
        (str(made), "w", 1), (str(made), "r", 0),
        (str(tmp_path / "__pycache__" / "helper.cpython-311.pyc"), "rb", 0),
    ):  # fmt: skip
        reads.hook("open", (path, mode, flags))
    assert reads.report() == {
        str(read): stamp(str(read)), str(table): stamp(str(table)),
        str(tmp_path / "gone.py"): None, str(tmp_path / "helper.py"): None,
    }  # fmt: skip
    before = stamp(str(read))
    read.write_text("x = 2 + 2\n", encoding="utf-8")
    assert stamp(str(read)) != before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("{model}", "{model}"), "--watch shows one model and writes no page: give one MODEL"),
        (("{model}", "-o", "page.html"), "--watch shows one model and writes no page"),
        (("{model}.toml",), "no such file"),
        (("{folder}",), "it is a folder"),
    ],
)
def test_that_wrong_usage_is_told(kincompile, model, arguments, message):
    pytest.importorskip("watchfiles", reason="watchfiles is not installed")
    done = kincompile(
        "view", "--watch", *(part.format(model=model, folder=model.parent) for part in arguments)
    )
    assert (done.exit_code, message in done.stderr) == (2, True), done.stderr


def test_that_its_absence_is_told(kincompile, model, monkeypatch):
    monkeypatch.setitem(sys.modules, "watchfiles", None)
    done = kincompile("view", model, "--watch")
    assert done.exit_code == 2
    assert done.stderr == (
        "Error: watchfiles is not installed; pip install -e '.[watch]' in the checkout brings it\n"
    )
