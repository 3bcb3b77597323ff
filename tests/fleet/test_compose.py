"""The compose file of a fleet: nothing listens beyond this machine, no password stands in it."""

import re
import tomllib
from pathlib import Path

import pytest

from taxel.fleet.reports import ROOT as TOPICS
from taxel.fleet.reports import Report

yaml = pytest.importorskip("yaml", reason="needs PyYAML")
FOLDER = Path(__file__).parents[2] / "deploy" / "fleet"


def test_every_port_is_bound_to_this_machine() -> None:
    services = yaml.safe_load((FOLDER / "compose.yaml").read_text())["services"]
    ports = [port for service in services.values() for port in service.get("ports", ())]
    assert len(ports) == 2
    assert all(port.startswith("127.0.0.1:") for port in ports)


def test_every_file_that_is_mounted_is_there_or_is_the_users_own() -> None:
    services = yaml.safe_load((FOLDER / "compose.yaml").read_text())["services"]
    mounted = [v.partition(":")[0] for s in services.values() for v in s.get("volumes", ())]
    files = [FOLDER / name for name in mounted if name.startswith("./") and name != "./users"]
    assert files
    assert all(file.is_file() for file in files)


def test_no_password_has_a_default() -> None:
    text = "".join(file.read_text() for file in FOLDER.iterdir() if file.is_file())
    given = re.findall(r"PASSWORD[:=] *(\S+)", text)
    assert all(value.startswith(("${", "(as")) for value in given), given


def test_the_broker_lets_nobody_in_without_a_name() -> None:
    lines = (FOLDER / "mosquitto.conf").read_text().splitlines()
    assert "allow_anonymous false" in lines
    assert any(line.startswith("acl_file ") for line in lines)
    assert not re.search("write", (FOLDER / "access.conf").read_text().partition("user fleet")[2])


def test_the_collector_keeps_fields_that_reports_have() -> None:
    settings = tomllib.loads((FOLDER / "telegraf.conf").read_text())
    (consumer,) = settings["inputs"]["mqtt_consumer"]
    (parser,) = consumer["json_v2"]
    names = [field["path"].partition(".")[0] for field in parser["field"] + parser["tag"]]
    assert set(names) <= set(Report.__dataclass_fields__)
    assert consumer["topics"] == [f"{TOPICS}/+/report"]
