"""The stubs of messages agree with the .msg and .srv files, and have a name for each type."""

from __future__ import annotations

import importlib.util
from types import ModuleType

import pytest

from quadrotor.checkout import ROOT
from vehicle_link.messages import records


@pytest.fixture(scope="module")
def generator() -> ModuleType:
    spec = importlib.util.spec_from_file_location("types", ROOT / "scripts" / "message_types.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_stubs_are_those_of_the_definitions(generator: ModuleType) -> None:
    for path, made in generator.STUBS.items():
        assert path.read_text() == made(), f"{path.name}: run scripts/message_types.py"


def test_every_type_can_be_imported_for_annotations(generator: ModuleType) -> None:
    names = {generator.class_name(stored) for stored in generator.described()}
    assert {"VehicleStatus", "CommandRequest", "Odometry"} <= names
    assert all(issubclass(getattr(records, name), records.Message) for name in names)


def test_no_private_name_is_a_type() -> None:
    with pytest.raises(AttributeError, match="_private"):
        getattr(records, "_private")  # noqa: B009
