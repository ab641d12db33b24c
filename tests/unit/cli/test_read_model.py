import sys

import pytest

import kincompile as kc

IMPORT = "import kincompile as kc\n"


@pytest.fixture
def model(tmp_path):
    """Return a function that writes a file and reads the model in it."""

    def read(text, name="model.py"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return kc.read_model(path)

    return read


def test_that_the_only_model_is_taken_whatever_its_name(model):
    assert model(f"{IMPORT}boom = kc.Mechanism('boom')").name == "boom"
    system = model(f"{IMPORT}s = kc.ConstraintSystem('s', 'x', [kc.Mechanism('a').parameter('x')])")
    assert isinstance(system, kc.ConstraintSystem)


@pytest.mark.parametrize(
    ("names", "taken"),
    [("a mechanism", 1), ("m a", 0), ("a system m", 1), ("m system mechanism", 2)],
)
def test_that_of_several_the_one_with_a_preferred_name_is_taken(model, names, taken):
    lines = [f"{name} = kc.Mechanism('number_{k}')" for k, name in enumerate(names.split())]
    assert model(IMPORT + "\n".join(lines)).name == f"number_{taken}"


def test_that_two_names_of_one_model_are_no_conflict(model):
    assert model(f"{IMPORT}a = b = kc.Mechanism('boom')").name == "boom"


def test_that_a_file_imports_its_neighbours_and_finds_its_data(model, tmp_path, monkeypatch):
    (tmp_path / "dimensions.py").write_text("LENGTH = 3\n")
    (tmp_path / "name.txt").write_text("boom")
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    text = (
        f"{IMPORT}from pathlib import Path\nfrom dimensions import LENGTH\n"
        "m = kc.Mechanism(Path(__file__).with_name('name.txt').read_text(), points=LENGTH)"
    )
    read = model(text)
    assert (read.name, read.points) == ("boom", 3)
    del sys.modules["dimensions"]


def test_that_the_script_part_does_not_run(model):
    assert model(f"{IMPORT}m = kc.Mechanism('boom')\nif __name__ == '__main__':\n    1 / 0\n")


def test_that_a_dataclass_finds_its_module(model):
    text = (
        "from __future__ import annotations\nfrom dataclasses import dataclass\n"
        f"{IMPORT}@dataclass\nclass Link:\n    length: float\n"
        "m = kc.Mechanism('boom', end=Link(2.0).length)"
    )
    assert model(text).end == 2.0


def test_that_reading_leaves_no_trace(model, tmp_path):
    before = sys.path.copy(), set(sys.modules)
    model(f"{IMPORT}import sys\nsys.path.clear()\nm = kc.Mechanism('boom')")
    with pytest.raises(kc.ModelError, match="line 1: RuntimeError: no"):
        model("raise RuntimeError('no')")
    assert (sys.path, set(sys.modules)) == before
    assert [path.name for path in tmp_path.iterdir()] == ["model.py"]


def test_that_an_encoding_is_obeyed(tmp_path):
    path = tmp_path / "model.py"
    text = f"# -*- coding: latin-1 -*-\n{IMPORT}m = kc.Mechanism('boom', length_unit='µm')"
    path.write_bytes(text.encode("latin-1"))
    assert kc.read_model(path).length_unit == "µm"


def test_that_the_line_is_that_of_the_file_and_not_of_what_it_calls(model):
    text = f"{IMPORT}\ndef build():\n    return kc.ConstraintSystem('s', 'x', [])\n\nm = build()\n"
    with pytest.raises(kc.ModelError, match=r"model\.py, line 4: 's' has no constraints"):
        model(text)


def test_that_a_bug_stays_a_bug(model):
    with pytest.raises(kc.InternalError, match="the impossible"):
        model(f"{IMPORT}raise kc.InternalError('the impossible happened.')")


def test_that_ctrl_c_is_not_the_fault_of_the_model(model):
    with pytest.raises(KeyboardInterrupt):
        model("raise KeyboardInterrupt")


@pytest.mark.parametrize("text", ["# -*- coding: klingon -*-\n", "s = '\ufeff'\x00"])
def test_that_what_is_no_text_is_refused(model, text):
    with pytest.raises(kc.ModelError, match=r"model\.py.*this is not"):
        model(text)


def test_that_bytes_which_are_no_utf8_are_refused(tmp_path):
    (tmp_path / "model.py").write_bytes(b"x = '\xff\xfe'\n")
    with pytest.raises(kc.ModelError, match=r"model\.py.*this is not"):
        kc.read_model(tmp_path / "model.py")


def test_that_a_file_that_cannot_be_read_is_refused(tmp_path):
    (tmp_path / "loop.py").symlink_to(tmp_path / "loop.py")
    with pytest.raises(kc.InputError, match=r"cannot read .*loop\.py: .*check the path"):
        kc.read_model(tmp_path / "loop.py")
    with pytest.raises(kc.InputError, match=r"cannot read .*null.*check the path"):
        kc.read_model("a\0b.py")
