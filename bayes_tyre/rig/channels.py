"""The section of a rig file that says which column of a raw file is which, by name or by number."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, PlainValidator, ValidationError, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError


class Section(BaseModel):
    """A section of a rig file."""

    # Strict, so that a quoted number or a true where a length belongs is found rather than converted.
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


def _name_or_column(value: object) -> str | int:
    named = isinstance(value, str) and value.strip()
    if not (named or (isinstance(value, int) and not isinstance(value, bool) and value >= 1)):
        raise PydanticCustomError("channel", "Should be a name, or a column's number from 1 on")
    assert isinstance(value, str | int)
    return value


NameOrColumn = Annotated[str | int, PlainValidator(_name_or_column)]


class Channels(Section):
    """Which column of a raw file is which; the voltages serve where the engineering channels are missing.

    A number is that of a column, a spreadsheet's A being 1. Where one is given, `time` counts: the column of X, in s.
    """

    acceleration: NameOrColumn = "Acc m/s^2"
    displacement: NameOrColumn = "Disp mm"
    load: NameOrColumn = "Load kN"
    acceleration_voltage: NameOrColumn = "Raw Acc Voltage"
    displacement_voltage: NameOrColumn = "Raw Disp Voltage"
    load_voltage: NameOrColumn = "Raw Load Voltage"
    time: Annotated[int, Field(ge=1)] = 1

    @property
    def by_number(self) -> bool:
        """Whether a channel is given by its column's number."""
        return any(isinstance(column, int) for key, column in self if key != "time")

    @model_validator(mode="after")
    def _one_each(self) -> "Channels":
        taken: dict[str | int, str] = {}
        for key, column in self:
            place = column.strip() if isinstance(column, str) else column
            if (key != "time" or self.by_number) and taken.setdefault(place, key) != key:
                context = {"other": taken[place]}
                kind = PydanticCustomError("twice", "Should be another than that of channels.{other}", context)
                where = InitErrorDetails(type=kind, loc=(key,), input=column)
                raise ValidationError.from_exception_data("rig", [where])
        if "time" in self.model_fields_set and not self.by_number:
            kind = PydanticCustomError("alone", "Should stand beside channels given by number, of which there are none")
            raise ValidationError.from_exception_data(
                "rig", [InitErrorDetails(type=kind, loc=("time",), input=self.time)]
            )
        return self
