"""The machine as read from a TOML file."""

from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field, FiniteFloat, ValidationError, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

from bayes_tyre.embedded import data_path
from bayes_tyre.errors import BadInput
from bayes_tyre.formats.structured_text import read_toml
from bayes_tyre.plain_text import reason
from bayes_tyre.rig.channels import Channels, Section
from bayes_tyre.rig.faults import EXPLAINED, first_fault

#: Acceleration of free fall as the source takes it, m/s^2.
GRAVITY_M_PER_S2 = 9.81
EMBEDDED_RIGS = ("single", "dual")
_CHOICES = f"{' or '.join(EMBEDDED_RIGS)}, or the path of a TOML file"

Positive = Annotated[FiniteFloat, Field(gt=0)]
NotNegative = Annotated[FiniteFloat, Field(ge=0)]
Name = Annotated[str, Field(min_length=1)]


def _share(value: float) -> float:
    if value > 1:
        raise PydanticCustomError("share", "Should be a share, not per cent (0.2 for 20 %)")
    return value


Share = Annotated[NotNegative, AfterValidator(_share)]


def _missing(*keys: str) -> ValidationError:
    """Return the fault of a section that is only half described, by the keys that it lacks."""
    return ValidationError.from_exception_data(
        "rig", [InitErrorDetails(type="missing", loc=tuple(key.split(".")), input=None) for key in keys]
    )


class Axle(Section):
    """Lever arms (mm), masses (kg) and the axle's own load on the tyre (kN).

    Of the lever arms only ratios enter. A machine whose actuator and sensors act at the wheel centre has none: all
    three left out are alike.
    """

    support_to_wheel_centre_mm: Positive = 1.0
    support_to_load_mm: Positive = 1.0
    support_to_measurement_mm: Positive = 1.0
    mass_kg: Positive | None = None
    axle_load_kN: NotNegative
    effective_mass_kg: Positive
    effective_mass_relative_sd: Share = 0.1

    @property
    def has_lever(self) -> bool:
        """Whether the lever arms are described."""
        return "support_to_wheel_centre_mm" in self.model_fields_set

    @model_validator(mode="after")
    def _all_lever_arms_or_none(self) -> "Axle":
        arms = ("support_to_wheel_centre_mm", "support_to_load_mm", "support_to_measurement_mm")
        absent = [arm for arm in arms if arm not in self.model_fields_set]
        if 0 < len(absent) < len(arms):
            raise _missing(*absent)
        return self


class Tyre(Section):
    """The tyre: its unloaded radius (mm)."""

    unloaded_radius_mm: Positive


class Rollers(Section):
    """The pair of rollers: their radius and half the distance between their axes (mm)."""

    radius_mm: Positive
    half_spacing_mm: Positive


class Beam(Section):
    """The beam's section (mm), density (kg/m^3) and Young's modulus (GPa)."""

    outer_width_mm: Positive
    outer_height_mm: Positive
    inner_width_mm: Positive
    inner_height_mm: Positive
    outer_fillet_mm: NotNegative
    inner_fillet_mm: NotNegative
    density_kg_per_m3: Positive
    youngs_modulus_GPa: Positive


class Calibration(Section):
    """Lines from volts to engineering units, value = slope * volts + intercept; a sensor may have none."""

    acceleration_slope_m_per_s2_per_V: FiniteFloat | None = None
    acceleration_intercept_m_per_s2: FiniteFloat | None = None
    displacement_slope_mm_per_V: FiniteFloat | None = None
    displacement_intercept_mm: FiniteFloat | None = None
    load_slope_kN_per_V: FiniteFloat | None = None
    load_intercept_kN: FiniteFloat | None = None

    @model_validator(mode="after")
    def _slope_and_intercept_or_neither(self) -> "Calibration":
        keys = list(type(self).model_fields)
        for pair in zip(keys[::2], keys[1::2], strict=True):
            absent = [key for key in pair if getattr(self, key) is None]
            if len(absent) == 1:
                raise _missing(*absent)
        return self


class Signs(Section):
    """Whether each reading has the sign its key says (True) or the opposite (False)."""

    acceleration_positive_upward: bool = True
    displacement_grows_downward: bool = True
    load_positive_into_rollers: bool = True


class Sensors(Section):
    """How late displacement sensor and load cell read behind the accelerometer: ms, and how well that is known."""

    displacement_delay_ms: FiniteFloat = 0.0
    displacement_delay_sd_ms: NotNegative = 2.0
    load_delay_ms: FiniteFloat = 0.0
    load_delay_sd_ms: NotNegative = 2.0


class Accuracy(Section):
    """How accurate a rig's factors are, by standard deviations: of load cell and displacement sensor, and lever arms.

    They are errors that all recordings of the rig share; nothing is known of one that is 0.
    """

    load_relative_sd: Share = 0.0
    displacement_relative_sd: Share = 0.0
    lever_arm_sd_mm: NotNegative = 0.0


class SecondMode(Section):
    """A second mode of the rig, such as its beam's bending: its frequency (Hz), and how well that is known."""

    frequency_Hz: Positive
    frequency_relative_sd: Share = 0.1


class Rig(Section):
    """One axle and the ground under its tyre; `data/rigs/README.md` explains every key.

    Without `rollers` the tyre stands on flat ground; the tyre's radius then serves only the runout of a rolling one.
    """

    name: Name
    description: str = ""
    axle: Axle
    tyre: Tyre | None = None
    rollers: Rollers | None = None
    beam: Beam | None = None
    calibration: Calibration = Calibration()
    channels: Channels = Channels()
    signs: Signs = Signs()
    sensors: Sensors = Sensors()
    accuracy: Accuracy = Accuracy()
    second_mode: SecondMode | None = None

    @model_validator(mode="after")
    def _whole(self) -> "Rig":
        absent = ["tyre"] if self.rollers and not self.tyre else []
        if self.beam and not self.axle.has_lever:
            absent += ["axle.support_to_wheel_centre_mm", "axle.support_to_load_mm", "axle.support_to_measurement_mm"]
        if self.beam and self.axle.mass_kg is None:
            absent.append("axle.mass_kg")
        if self.accuracy.lever_arm_sd_mm and not self.axle.has_lever:
            absent.append("axle.support_to_wheel_centre_mm")
        if absent:
            raise _missing(*absent)
        if self.rollers and self.tyre:
            given = self.rollers.half_spacing_mm
            if given >= self.rollers.radius_mm + self.tyre.unloaded_radius_mm:
                kind = PydanticCustomError("too_wide", "Should be below the radii of roller and tyre together")
                where = InitErrorDetails(type=kind, loc=("rollers", "half_spacing_mm"), input=given)
                raise ValidationError.from_exception_data("rig", [where])
        return self


def load_rig(name_or_path: str | Path) -> Rig:
    """Return a rig: `single` or `dual` of the published tests, or the one a TOML file describes.

    Parameters
    ----------
    name_or_path:
        ``"single"``, ``"dual"``, or the path of a TOML file with the keys of `data/rigs/README.md`.

    Raises
    ------
    BadInput
        If the file is missing, no TOML, or a key is missing, unknown or has a value that cannot be.

    Examples
    --------
    >>> load_rig("single").axle.support_to_wheel_centre_mm
    1300.0
    """
    embedded = str(name_or_path) in EMBEDDED_RIGS
    path = data_path(f"rigs/{name_or_path}.toml") if embedded else Path(name_or_path)
    try:
        content = read_toml(path)
    except IsADirectoryError:
        raise BadInput(f"{path}: is a folder, not a rig file; name {_CHOICES}") from None
    except FileNotFoundError:
        raise BadInput(f"{path}: no such rig file; name {_CHOICES}") from None
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}; name {_CHOICES}") from None
    except ValueError as error:
        raise BadInput(f"{path}: cannot be read as TOML: {reason(error)}; mend the file") from None
    try:
        return Rig.model_validate(content)
    except ValidationError as error:
        raise BadInput(f"{path}: {first_fault(error, Rig, content)}") from None


def needed[T](value: T | None, rig: Rig, key: str) -> T:
    """Return what a rig file may leave out, where it is needed after all.

    Raises
    ------
    BadInput
        If this one has left it out.
    """
    if value is None:
        raise BadInput(f"rig {rig.name!r}, key {key}: is missing; add it, {EXPLAINED}")
    return value
