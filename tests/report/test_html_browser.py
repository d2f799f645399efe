"""The HTML report in a real browser: it opens, acts, prints, and obeys no name."""

from __future__ import annotations

import re
import shutil
import subprocess
from typing import TYPE_CHECKING

import pytest
from kit import html_samples as samples

from analyzer.report.html import render

if TYPE_CHECKING:
    from pathlib import Path

CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), ""
)

pytestmark = pytest.mark.skipif(not CHROMIUM, reason="no chromium is installed")


def browse(page: Path, *flags: str) -> str:
    profile = f"--user-data-dir={page.parent / 'user'}"
    quiet = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage")
    command = [CHROMIUM, *quiet, profile, *flags, page.as_uri()]
    return subprocess.run(command, capture_output=True, check=True, timeout=120).stdout.decode()


@pytest.mark.slow
def test_a_browser_shows_it(tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    page.write_text(render(samples.faulty()), encoding="utf-8")
    seen = browse(page, "--dump-dom")
    assert "7 findings" in seen  # the script ran, so the policy knows it
    assert "frame 2 of 3 is missing: toggle 0 where 1 was due" in seen
    assert "52 AE 2B 4C 4D 00 00" in seen


@pytest.mark.slow
def test_a_link_opens_its_finding(tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    jump = '<meta http-equiv="refresh" content="0;url=#f2">'
    page.write_text(render(samples.faulty()).replace("</title>", f"</title>{jump}", 1), encoding="utf-8")
    seen = browse(page, "--virtual-time-budget=2000", "--dump-dom")
    opened = [of for of in re.findall(r'<details class="finding[^>]*>', seen) if " open" in of]
    assert len(opened) == 1


@pytest.mark.sampled(4)
@pytest.mark.parametrize("text", [samples.HOSTILE[k] for k in (0, 5, 6, 7)], ids=range(4))
def test_a_browser_obeys_no_name(tmp_path: Path, text: str) -> None:
    """Were a name obeyed, it would leave a mark in the page."""
    page = tmp_path / "report.html"
    page.write_text(render(samples.hostile(text.replace("alert(1)", "document.title='owned'"))), encoding="utf-8")
    seen = browse(page, "--dump-dom")
    assert seen.count("<script") == seen.count("<style") == 1
    assert "<img" not in seen
    assert "<title>owned" not in seen


@pytest.mark.slow
def test_a_browser_opens_a_long_report(tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    page.write_text(render(samples.long()), encoding="utf-8")
    assert "5000 findings" in browse(page, "--dump-dom")


@pytest.mark.sampled(4)
@pytest.mark.parametrize("script", [True, False], ids=["script", "style alone"])
def test_printing_opens_every_finding(tmp_path: Path, script: bool) -> None:
    written = render(samples.faulty())
    if not script:
        written = re.sub(r"<script>.*?</script>", "", written, flags=re.DOTALL)
    closed = re.sub(r'<div class="body".*?</details>', "</details>", written, flags=re.DOTALL)
    sizes = []
    for name, content in (("open", written), ("closed", closed)):
        page = tmp_path / f"{name}.html"
        page.write_text(content, encoding="utf-8")
        browse(page, f"--print-to-pdf={tmp_path / name}.pdf")
        sizes.append((tmp_path / f"{name}.pdf").stat().st_size)
    assert sizes[0] > 1.1 * sizes[1]
