"""What taxel brings along: vendored files as published, licences agreed to, a whole bill."""

import hashlib
import json
import tomllib
from pathlib import Path

import pytest
from supply.distributions import DEVELOPMENT, extras, required, vendored

from supply import licences, sbom
from taxel.views.page.assets import VENDORED, load_assets


def test_vendored_files_are_those_that_were_published_and_no_others():
    listed = {name: digest for package in vendored() for name, digest in package["files"].items()}
    found = {path.name: hashlib.sha256(path.read_bytes()).hexdigest()
             for path in VENDORED.iterdir() if path.name != "vendored.json"}  # fmt: skip

    assert found == listed
    for package in vendored():
        assert "Permission is hereby granted" in (VENDORED / package["license_file"]).read_text()


def test_the_page_serves_uplot_and_neither_its_licence_file_nor_the_list():
    assets = load_assets()

    assert assets["uPlot.iife.js"].media_type.startswith("text/javascript")
    assert assets["uPlot.min.css"].media_type.startswith("text/css")
    assert not {"uPlot.LICENSE", "vendored.json"} & set(assets)


@pytest.mark.parametrize(("licence", "fine"), [
    ("MIT", True), ("Apache-2.0 OR GPL-3.0-only", True), ("Apache-2.0 AND GPL-3.0-only", False),
    ("(MIT OR GPL-2.0-only) AND BSD-3-Clause", True), ("(MIT AND ISC) OR LGPL-3.0-only", True),
    ("GNU Lesser General Public License v3 (LGPLv3)", False), ("", False), ("Proprietary", False),
])  # fmt: skip
def test_a_choice_needs_one_fine_licence_and_a_sum_all(licence, fine):
    assert licences.is_allowed(licence) is fine


@pytest.mark.slow
def test_a_distribution_under_another_licence_is_named(monkeypatch):
    monkeypatch.setattr(licences, "ALLOWED", licences.ALLOWED - {"BSD-3-Clause"})
    found = licences.problems()

    assert any(line.startswith("taxel: numpy ") for line in found)
    assert not any("uplot " in line for line in found)


def test_every_extra_is_walked_to_its_end():
    live = set(required())

    assert {"numpy", "mcap", "rich"} <= live
    assert "torch" not in live
    assert {"torch", "markupsafe"} <= set(required("train"))  # torch → jinja2 → markupsafe
    assert "pytest" in required("dev")
    assert set(DEVELOPMENT) <= set(extras())


def test_the_bill_lists_what_users_get_and_what_lies_in_the_page():
    parts = [{"type": "library", "bom-ref": f"{name}==1", "name": name, "version": "1"}
             for name in ("numpy", "pytest", "some-other-tool")]  # fmt: skip
    bill = {
        "bomFormat": "CycloneDX", "specVersion": "1.6", "components": parts,
        "metadata": {"component": {"bom-ref": "root-component"}},
        "dependencies": [{"ref": "root-component", "dependsOn": ["numpy==1", "pytest==1"]},
                         {"ref": "pytest==1"}],
    }  # fmt: skip
    found = json.loads(json.dumps(sbom.finish(bill)))

    assert [part["name"] for part in found["components"]] == ["numpy", "uplot"]
    (root,) = found["dependencies"]
    assert root["dependsOn"] == ["numpy==1", "pkg:npm/uplot@1.6.32"]
    assert {"name": "taxel:brought-by", "value": "always"} in found["components"][0]["properties"]


def test_the_version_to_cite_is_the_package_s():
    root = Path(__file__).parents[2]
    version = tomllib.loads((root / "pyproject.toml").read_text())["project"]["version"]
    assert f"version: {version}" in (root / "CITATION.cff").read_text().splitlines()
