"""Which files are exempt from strict type checks: those whose kernels are compiled, and no others."""

import re
import tomllib

from places import ROOT

LAXER = re.compile(r"^\s*#\s*pyright:\s*(?:basic|standard)\b", re.MULTILINE)
COMPILES = re.compile(
    r"^\s*(?:(?:from|import)\s+(?:features\.compiled|numba)\b|from\s+features\s+import\s.*\bcompiled\b)", re.MULTILINE
)


def test_files_with_compiled_kernels_and_no_others_are_exempt_from_strict_types():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["pyright"]
    assert settings["typeCheckingMode"] == "strict"
    files = [path for folder in settings["include"] for path in (ROOT / folder).rglob("*.py")]
    texts = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in files}
    exempt = {name for name, text in texts.items() if LAXER.search(text)}
    assert exempt == {name for name, text in texts.items() if COMPILES.search(text)}
    assert exempt == {name for name in exempt if texts[name].startswith("# pyright: standard\n")}
