"""A gauge of the noise of a scanner, which a run carries along."""

import math
from dataclasses import dataclass, replace

import numpy as np

from features.noise.measure import Extract, RangeNoise, line_scatter, measure_sigma, pooled_noise
from features.noise.rules import NoiseRules
from features.noise.steps import no_return_range, range_step
from features.scan import LaserScan
from features.se2 import Array
from features.sensor import SensorModel


@dataclass(frozen=True, slots=True)
class NoiseSummary:
    """What a run knows of the noise of its scanner.

    Parameters
    ----------
    used : ``measured`` where the run uses what it measured, ``given`` where it uses the configuration.
    scans : scans of the start, on which it was measured.
    sigma_range_mm : measured standard deviation of a range; None where the scans showed too few walls [mm].
    error : relative standard error of it, None likewise.
    growth_mm_per_m : growth of the standard deviation with range; 0 where it is within chance [mm/m].
    range_step_mm : step of the ranges, 0 for none [mm].
    no_return_m : range that stands for no return, None for none [m].
    in_use_mm : standard deviation of a range that the run uses [mm].
    given_mm : that of the configuration [mm].
    range_max_m : largest range in use [m].
    """

    used: str
    scans: int
    sigma_range_mm: float | None
    error: float | None
    growth_mm_per_m: float
    range_step_mm: float
    no_return_m: float | None
    in_use_mm: float
    given_mm: float
    range_max_m: float

    @property
    def sentence(self) -> str:
        """All of it in one line."""
        if self.sigma_range_mm is None:
            said = f"too few walls in {self.scans} scans to measure it, {self.in_use_mm:.3g} mm as given"
        else:
            said = f"{self.sigma_range_mm:.3g} mm measured on {self.scans} scans, {self.given_mm:.3g} mm given"
            if self.used == "given":
                said += " and used"
        grows = f", growing by {self.growth_mm_per_m:.2g} mm/m" if self.growth_mm_per_m > 0.0 else ""
        steps = f", steps of {self.range_step_mm:.3g} mm" if self.range_step_mm > 0.0 else ""
        empty = "" if self.no_return_m is None else f", {self.no_return_m:.2f} m is no return"
        return f"noise of a range: {said}{grows}{steps}{empty}"


class NoiseGauge:
    """Measures the noise of a scanner on the first scans of a run, and watches it afterwards.

    Where the first scans do not tell it well enough, twice as many are taken, and so on up to a limit.

    Parameters
    ----------
    model : sensor as it was configured.
    extract : the extraction of the run, which takes no wall apart for what the assumed noise does not explain.
    use : whether the run is to use what is measured.
    rules : see there.

    Attributes
    ----------
    sensor : model to use.
    ready : whether it is final.
    """

    def __init__(self, model: SensorModel, extract: Extract, *, use: bool, rules: NoiseRules) -> None:
        self.sensor = model
        self.ready = False
        self._given = model
        self._extract = extract
        self._use = use
        self._rules = rules
        self._start: list[LaserScan] = []
        self._next = rules.start_scans
        self._measured = self._watched = 0
        self._scatter: list[Array] = []
        self._noise: RangeNoise | None = None
        self._step = 0.0
        self._no_return: float | None = None

    def see(self, scan: LaserScan) -> bool:
        """See a scan as it was taken; return whether :attr:`sensor` has changed."""
        self._start.append(scan)
        if len(self._start) < self._next:
            return False
        self._next *= 2
        return self._measure(last=self._next > self._rules.most_scans)

    def end(self) -> bool:
        """Measure on the scans so far, as no more will come; return whether :attr:`sensor` has changed."""
        return bool(self._start) and self._measure(last=True)

    def leave(self) -> None:
        """Measure nothing."""
        self.ready = True

    def _measure(self, *, last: bool) -> bool:
        scans, rules, before, model = self._start, self._rules, self.sensor, self._given
        self._measured = len(scans)
        self._step = range_step(np.concatenate([scan.ranges[model.returned(scan.ranges)] for scan in scans]), rules)
        empty = no_return_range(scans, self._step, rules)
        if empty is not None and empty[1] > model.range_min:
            self._no_return = empty[0]
            model = replace(model, range_max=min(model.range_max, empty[1]))
        self._noise = measure_sigma(scans, model, self._extract, rules)
        self.ready = last or (self._noise is not None and self._noise.error <= rules.wanted_error)
        if not self.ready:
            return False
        if self._noise is not None:
            # The lines that tell the noise are nearer than what a scan shows beside them.
            middle = np.median(np.concatenate([scan.ranges[model.returned(scan.ranges)] for scan in scans]))
            self._noise = self._noise.carried_to(float(middle))
        if self._use:
            sigma = self._given.sigma_range if self._noise is None else self._noise.sigma
            self.sensor = replace(model, sigma_range=max(sigma, self._step / math.sqrt(12.0)))
        self._start = []
        return self.sensor != before

    def watch(self, scan: LaserScan) -> float | None:
        """Watch a scan, without the motion during its sweep.

        Only every few scans is one extracted, by the rules of the gauge: lines that are split at what the assumed noise
        does not explain would hide that the noise is larger.

        Returns
        -------
        Standard deviation of a range that the latest scans, or those of the start, show where :attr:`sensor` has
        another [m]; else None.
        """
        if not self.ready:
            return None
        rules = self._rules
        noise = self._noise if self._watched == 0 else None
        if self._watched % rules.watched == 0:
            self._scatter.append(line_scatter(scan, self._extract(scan, self.sensor).lines, self.sensor, rules))
        self._watched += 1
        if self._watched % rules.window == 0:
            noise = pooled_noise(np.concatenate(self._scatter), rules)
            self._scatter = self._scatter[:0]
        return noise.sigma if noise is not None and self._contradicts(noise) else None

    def _contradicts(self, noise: RangeNoise) -> bool:
        """Whether the variance in use and the one seen differ by more than a factor and chance."""
        rules = self._rules
        factor = abs(2.0 * math.log(noise.sigma / self.sensor.sigma_range))
        return factor > math.log(rules.contradiction) + rules.significance * 2.0 * noise.error

    def summary(self) -> NoiseSummary | None:
        """Sum up what is known so far; None where nothing was measured."""
        if not self._measured:
            return None
        noise = self._noise
        return NoiseSummary(
            used="measured" if self._use else "given",
            scans=self._measured,
            sigma_range_mm=None if noise is None else 1e3 * noise.sigma,
            error=None if noise is None else noise.error,
            growth_mm_per_m=0.0 if noise is None else 1e3 * noise.growth,
            range_step_mm=1e3 * self._step,
            no_return_m=self._no_return,
            in_use_mm=1e3 * self.sensor.sigma_range,
            given_mm=1e3 * self._given.sigma_range,
            range_max_m=self.sensor.range_max,
        )
