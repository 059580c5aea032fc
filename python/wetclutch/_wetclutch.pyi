from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import Any, TypeAlias, final

from ._car import Car
from ._drive import Drive
from ._errors import InputError
from ._sensors import Sensors

__all__ = [
    "ClutchStep",
    "Numbers",
    "Observer",
    "StepEstimate",
    "Table",
    "__version__",
    "check_car",
    "check_drive",
    "check_sensors",
    "design",
    "errors_of_file",
    "errors_of_texts",
    "estimate",
    "export",
    "fit",
    "gearboxes",
    "log_channels",
    "log_map",
    "read_car",
    "restored_clutch",
    "restored_observer",
    "restored_step",
    "shifts_of_log",
    "simulate",
    "study_files",
    "study_rows",
    "study_table",
    "template_car",
]

__version__: str

@final
class Numbers:
    def __len__(self) -> int: ...
    def __buffer__(self, flags: int, /) -> memoryview: ...

@final
class Table:
    @property
    def names(self) -> list[str]: ...
    @property
    def units(self) -> list[str | None]: ...
    @property
    def left_out(self) -> list[str]: ...
    @staticmethod
    def from_arrow(object: Any) -> Table: ...
    @staticmethod
    def from_columns(columns: Mapping[str, Any]) -> Table: ...
    def numbers(self, name: str) -> Numbers | None: ...
    def words(self, name: str) -> list[str]: ...
    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object: ...
    def __len__(self) -> int: ...

_Reading: TypeAlias = float | tuple[float, float]

@final
class Observer:
    def __new__(
        cls,
        car: Car,
        *,
        shift: str | None = None,
        sensors: Sensors | str | PathLike[str] | None = None,
        learnt: str | None = None,
    ) -> Observer: ...
    def step(
        self,
        *,
        dt_s: float,
        engine_speed_rad_s: _Reading | None = None,
        turbine_speed_rad_s: _Reading | None = None,
        output_speed_rad_s: _Reading | None = None,
        wheel_speed_rad_s: _Reading | None = None,
        engine_torque_n_m: _Reading | None = None,
        acceleration_m_s2: _Reading | None = None,
        commands: Mapping[str, _Reading | None] | None = None,
        gear: str | None = None,
        target_gear: str | None = None,
        lock_up_applied: bool = False,
        oil_temperature_degc: float | None = None,
    ) -> StepEstimate: ...
    def pressure_range_pa(self, element: str) -> tuple[float, float] | None: ...
    @property
    def learnt(self) -> str: ...
    def __copy__(self) -> Observer: ...
    def __deepcopy__(self, memo: Any, /) -> Observer: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
    def __eq__(self, other: object, /) -> bool: ...

@final
class StepEstimate:
    @property
    def gear(self) -> str | None: ...
    @property
    def target_gear(self) -> str | None: ...
    @property
    def phase(self) -> str | None: ...
    @property
    def health(self) -> str: ...
    @property
    def offgoing(self) -> ClutchStep | None: ...
    @property
    def oncoming(self) -> ClutchStep | None: ...
    @property
    def turbine_torque_n_m(self) -> float | None: ...
    @property
    def shaft_torque_n_m(self) -> float | None: ...
    @property
    def flare_rad_s(self) -> float: ...
    @property
    def valve_model_pressures_pa(self) -> dict[str, float]: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
    def __eq__(self, other: object, /) -> bool: ...

@final
class ClutchStep:
    @property
    def element(self) -> str | None: ...
    @property
    def pressure_pa(self) -> float: ...
    @property
    def pressure_range_pa(self) -> tuple[float, float] | None: ...
    @property
    def torque_n_m(self) -> float: ...
    @property
    def torque_range_n_m(self) -> tuple[float, float] | None: ...
    @property
    def pressure_deviation_pa(self) -> float: ...
    @property
    def torque_deviation_n_m(self) -> float: ...
    @property
    def valve_model_pressure_pa(self) -> float: ...
    @property
    def valve_model_torque_n_m(self) -> float: ...
    @property
    def holds(self) -> bool: ...
    @property
    def hidden(self) -> bool: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
    def __eq__(self, other: object, /) -> bool: ...

def read_car(path: str) -> tuple[str, str, str, str | None, list[str], list[str]]: ...
def check_car(
    name: str, text: str, gearbox: str | None = None
) -> tuple[str, str, str, str | None, list[str], list[str]]: ...
def template_car(
    gearbox: str,
    name: str,
    mass_kg: float,
    wheel_radius_m: float | None,
    final_ratio: float | None,
    engine_torque_n_m: float | None,
    has_converter: bool | None,
    has_stroke: bool,
) -> tuple[str, str, str, str | None, list[str], list[str]]: ...
def gearboxes() -> list[str]: ...
def check_drive(drive: Drive | str) -> tuple[str, str, float]: ...
def check_sensors(sensors: Sensors | str) -> str: ...
def simulate(
    car: tuple[str, str, str | None],
    drive: Drive | str,
    sensors: Sensors | str | None,
    seed: int | None,
    progress: Callable[[str, float | None], object] | None,
) -> tuple[Table, Table, Table, tuple[float, int, float]]: ...
def design(
    car: tuple[str, str, str | None], shift: str | None, given: Mapping[str, Any]
) -> tuple[str, list[str], str]: ...
def export(
    car: tuple[str, str, str | None],
    shift: str | None,
    sensors: Sensors | str | None,
    program: bytes | None,
    c_source: bytes | None,
    fmu_libraries: Sequence[bytes],
    car_fmu_libraries: Sequence[bytes],
) -> list[tuple[str, bytes]]: ...
def estimate(
    car: tuple[str, str, str | None],
    path: str,
    table: Table | None,
    mapping: Mapping[str, Any],
    given: Mapping[str, Any],
    progress: Callable[[str, float | None], object] | None,
) -> tuple[Table, Table, list[str], str | None, str | None]: ...
def fit(
    car: tuple[str, str, str | None],
    logs: Sequence[tuple[str, Table | None, Mapping[str, Any]]],
    sensors: Sensors | str | None,
    with_page: bool,
    oil_step_k: float | None,
    progress: Callable[[str, float | None], object] | None,
) -> tuple[
    tuple[str, str, str, str | None, list[str], list[str]],
    tuple[Table, Table, Table | None],
    list[str],
    list[str],
    list[str],
    int,
    str | None,
    str | None,
]: ...
def study_files(path: str, text: str | None) -> tuple[list[tuple[str, str]], str, str, int, str, int]: ...
def study_rows(path: str, first: int, end: int, threads: int) -> bytes: ...
def study_table(path: str, lines: bytes, shown: str | None) -> tuple[Table, str | None]: ...
def log_channels(log: tuple[str, Table | None, Mapping[str, Any]]) -> Table: ...
def log_map(log: tuple[str, Table | None, Mapping[str, Any]]) -> str: ...
def shifts_of_log(log: tuple[str, Table | None, Mapping[str, Any]], ratios: Sequence[float]) -> Table: ...
def errors_of_file(path: str) -> list[InputError]: ...
def errors_of_texts(name: str, text: str, gearbox: str | None = None) -> list[InputError]: ...
def restored_observer(
    texts: tuple[str, str, str | None, str | None, tuple[str, str] | None], memory: bytes
) -> Observer: ...
def restored_step(bytes: bytes) -> StepEstimate: ...
def restored_clutch(bytes: bytes) -> ClutchStep: ...
