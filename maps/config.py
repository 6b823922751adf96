"""Settings of a map and of the costmap made from it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

UnknownPolicy = Literal["forbid", "penalize", "allow"]
"""What a planner may do with a cell that nobody has observed."""

SurfaceGuard = Literal["none", "floor"]
"""Which surfaces a beam spares that ends in them."""


NoReturn = Literal["free", "ignored"]
"""What a beam without return tells."""

HOLDING = ("dynamic", "voxel")
"""Kinds of which cells can be spared from decay."""


@dataclass(frozen=True)
class MapConfig:
    """Settings of a map and of the costmap made from it.

    Attributes:
        kind: Name of the representation, a key of `maps.MAPS`.
        resolution: Edge of a cell, m.
        hit: Log-odds that one return adds to its cell; 0.9 is p = 0.71. The steps and clamps are
            near OctoMap's (Hornung et al. 2013, Autonomous Robots 34: p 0.7 / 0.4, 0.12 to 0.97).
        miss: Log-odds that one beam takes from a cell it crosses; 0.4 is p = 0.40.
        clamp_low: Probability below which a cell never falls, so that it can be unlearned.
        clamp_high: Probability above which a cell never rises.
        half_life: Time in which unobserved evidence loses half its log-odds, s of simulated time;
            0 means no decay.
        hold_under_body: Half edge of the cube around a body's centre in which nothing is forgotten,
            m: what it stands on, its sensors often do not see. 0 is off, as what changes there
            unseen would be held as well. Kinds `voxel` and `dynamic` only.
        decay_period: Time between two decay ticks, s of simulated time.
        minimum_range: Nearer returns are dropped, m: they are mostly the sensor's own housing.
        no_return: What a beam tells that its sensor reports as without return: `free`, that there
            is nothing up to the range limit, as for OctoMap; or `ignored`, nothing at all, as by
            default for Nav2 (`inf_is_valid`). Where echoes get lost, the first makes holes in
            floors and walls; the second leaves a ghost where only the void is behind.
        surface_guard: `floor`: a beam that ends in the floor's layer takes no evidence from that
            layer, as it would at grazing angles; `none`: it does.
        band_low: Lower end of the heights that a flat grid sees, m above the floor; above the noise
            of the floor's own returns.
        band_high: Upper end, m; the `max_obstacle_height` of Nav2's obstacle layer.
        max_slope: Steepest ramp that a robot which walks may climb, rad; 0: the floor is flat. It
            asks for cells no larger than the steps that matter: see `Terrain`.
        class_margins: Extra distance that is kept to things by the name of their class, m; asks for
            sweeps that tell classes.
        memory_mib: Bound on the memory of the map's bricks, MiB; beyond it the bricks observed
            longest ago are dropped.
        inflation_margin: Localization margin that is added to the body's radius, m.
        cost_scaling_factor: Rate of the cost's fall with distance, 1/m. The law is that of Nav2's
            inflation layer, whose default of 10 lets paths run along every corner.
        cost_range: Distance beyond the forbidden radius over which cost is told, m.
        unknown_policy: `forbid`: unknown space is not entered; `penalize`: at a cost and slowly;
            `allow`: like free space.
        dynamic_after: Time for which a cell and its neighbours have to be free before something
            that appears there is held to have moved there, s; kind `dynamic` only, as all below.
            5 sweeps of 0.1 s, the burn-in of Dynablox (Schmid et al. 2023, RA-L 8).
        dynamic_at_once: Whether each cell that something appears in is dynamic with the first hit.
            If not, only cells of a thing are that was seen to move: surfaces that a beam meets for
            the first time stand still.
        vacated_after: Sweeps in a row that have to cross such a cell before it is free again; 2 is
            Dynablox's temporal buffer, which bridges the gaps between beams.
        static_after: Time after which something that was first met in such a cell is part of the
            surroundings, s. Dynablox waits for 150 sweeps of 0.1 s; but what looks like motion is
            often a surface between sparse beams, and at 0.25 m/s a body of 0.5 m has passed.
        look_ahead: Time for which moving things are foretold and their ways held occupied, s.
            The default spans two sweeps of 0.1 s.

    Raises:
        ValueError: A value is out of its range.
    """

    kind: str = "voxel"
    resolution: float = 0.1
    hit: float = 0.9
    miss: float = 0.4
    clamp_low: float = 0.12
    clamp_high: float = 0.97
    half_life: float = 30.0
    hold_under_body: float = 0.0
    decay_period: float = 1.0
    minimum_range: float = 0.3
    no_return: NoReturn = "free"
    surface_guard: SurfaceGuard = "floor"
    band_low: float = 0.05
    band_high: float = 2.0
    max_slope: float = 0.0
    class_margins: dict[str, float] = field(default_factory=dict)
    memory_mib: int = 512
    inflation_margin: float = 0.1
    cost_scaling_factor: float = 4.0
    cost_range: float = 0.6
    unknown_policy: UnknownPolicy = "forbid"
    dynamic_after: float = 0.5
    dynamic_at_once: bool = False
    vacated_after: int = 2
    static_after: float = 2.0
    look_ahead: float = 0.2

    def __post_init__(self) -> None:
        """Check every field."""
        self._check("resolution", 0.01, 0.5, " m")
        self._check("hit", 0.01, 10.0)
        self._check("miss", 0.01, 10.0)
        # Within these, 8 bits hold at least 18 units to one of log-odds.
        self._check("clamp_low", 0.001, 0.499)
        self._check("clamp_high", 0.501, 0.999)
        self._check("half_life", 0.0, 1e6, " s")
        self._check("hold_under_body", 0.0, 5.0, " m")
        if self.hold_under_body > 0.0 and self.kind not in HOLDING:
            raise ValueError(
                f"map.hold_under_body: got {self.hold_under_body:g} with kind {self.kind!r}, "
                f"expected 0, or one of the kinds {', '.join(HOLDING)}"
            )
        self._check("decay_period", 0.01, 3600.0, " s")
        self._check("minimum_range", 0.0, 60.0, " m")
        self._check("band_low", 0.0, 10.0, " m")
        self._check("band_high", self.band_low + 0.01, 100.0, " m")
        self._check("max_slope", 0.0, 0.6, " rad")
        for name, margin in self.class_margins.items():
            if not 0.0 <= margin <= 5.0:
                raise ValueError(f"map.class_margins.{name}: got {margin:g}, expected 0 to 5 m")
        self._check("memory_mib", 1, 65536, " MiB")
        self._check("inflation_margin", 0.0, 5.0, " m")
        self._check("cost_scaling_factor", 0.1, 1000.0, " 1/m")
        self._check("cost_range", 0.0, 10.0, " m")
        self._check("dynamic_after", 0.01, 3600.0, " s")
        self._check("vacated_after", 1, 1000, " sweeps")
        self._check("static_after", 0.01, 1e6, " s")
        self._check("look_ahead", 0.0, 10.0, " s")
        self._check_choice("no_return", get_args(NoReturn))
        self._check_choice("surface_guard", get_args(SurfaceGuard))
        self._check_choice("unknown_policy", get_args(UnknownPolicy))

    def _check(self, name: str, low: float, high: float, unit: str = "") -> None:
        value = getattr(self, name)
        if not low <= value <= high:  # also refuses NaN
            raise ValueError(f"map.{name}: got {value:g}, expected {low:g} to {high:g}{unit}")

    def _check_choice(self, name: str, choices: tuple[str, ...]) -> None:
        value = getattr(self, name)
        if value not in choices:
            raise ValueError(f"map.{name}: got {value!r}, expected one of {', '.join(choices)}")
