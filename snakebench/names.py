"""Names that tables, settings and pages share."""

SMALLER = ("quick", "smoke")  # profiles whose results stand beside the published ones, as STUDY-PROFILE
# Every study but quickstart, which is a small sea_snake; a study that reads results of others comes after them.
STUDIES = (
    *("validation", "sea_snake", "sea_snake_front", "pareto", "tuning", "teacher_student", "ablations", "memory"),
    *("learned_front", "limit", "fourier", "imitation", "gain_schedule"),
    *("operating_point", "cross", "adaptation", "relearned", "sensitivity", "robust", "robustness"),
)
PAPER, EXTENDED = "paper", "extended"  # search spaces of the sinusoidal torque: the paper's and a wider one
FASTER, STRONGER = "faster", "stronger"  # those between: wider in frequency only, and in torque only
# What tables call that which a gait is tuned to, where it is not one fluid.
INTEGRATED = "integrated"  # all fluids, by the mean over them
SIMPLE_SUM = "simple-sum"  # each fluid by a gait of its own, switched at once: the name of a front
CURRENCIES = {"net": "power", "positive": "positive_power"}  # of fronts, and the column of the power that each counts
ADAPTIVE = "adaptive"  # whichever fluid it finds itself in, as a policy
FINE, COARSE = "finer step", "coarser step"  # how a swim is computed: as published, and with steps that are longer
