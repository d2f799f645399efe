"""The tables of formats name what is there: a module that is moved takes its line along."""

from __future__ import annotations

import pytest
from kit.judged import registry
from kit.reports import faulty

from analyzer.report.formats import FORMATS, ReportFormat, by_suffix
from analyzer.views.formats import FORMATS as VIEWS
from analyzer.views.formats import ViewFormat


@pytest.mark.parametrize("form", FORMATS, ids=lambda form: form.name)
def test_a_report_can_be_made(form: ReportFormat) -> None:
    assert form.render(faulty()).strip()
    assert all(by_suffix(FORMATS)[suffix] == form.name for suffix in form.suffixes)


@pytest.mark.parametrize("form", VIEWS, ids=lambda form: form.name)
def test_a_view_can_be_made(form: ViewFormat) -> None:
    view = form.writer(registry())
    assert isinstance(view.begin() + view.end(), str)
