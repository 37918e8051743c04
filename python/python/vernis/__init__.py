"""How different do two materials look? Perceptual metrics for BRDFs, trained on human ratings.

Three steps:

>>> import vernis
>>> reference = vernis.model("ggx", kd=[0.2, 0.1, 0.05], f0=0.04, alpha=0.1)
>>> candidate = vernis.model("ggx", kd=[0.2, 0.1, 0.05], f0=0.04, alpha=0.2)
>>> vernis.metric("vernis").score(reference, candidate)        # distance, predicted mean opinion score, its interval
>>> vernis.compare(reference, candidate, ["vernis", "D9.Cl", "ot"])          # any number of metrics
>>> vernis.fit(reference, "ward-duer").brdf                                  # a fit under the metric to fit with

Wherever a BRDF is asked for, a notation (a file, a material of an archive), a `Brdf`, or a function ``(wi, wo) -> values`` of arrays
will do; so will a dictionary or XML of a Mitsuba BSDF, where Mitsuba is installed. Directions are unit vectors with +z the normal,
``wi`` towards the light and ``wo`` towards the viewer; values are linear RGB, 1/sr, cosine not included.

For an optimiser of your own: `Metric.prepare` pays for the reference once, `Prepared.nodes` says where the metric looks, and
`Prepared.value_and_grad` gives the distance and its gradient by the values there. `vernis.torch`, `vernis.drjit` and
`vernis.mitsuba`, which import these packages, build on it.

`Fit.to_mitsuba`, `Fit.to_pbrt`, `Fit.to_materialx` and `Fit.to_gltf` take a fit to a renderer, and `Fit.material` says what that costs.

What goes wrong is a `vernis.Error`; a wrong argument is also a ValueError, a missing file also a FileNotFoundError.
"""

from ._brdf import Brdf, Grid, Model, Parameter, Table, model, models, open
from ._errors import Error, InputError, NotFoundError, UnknownNameError
from ._export import Cost, Material, export
from ._fit import Fit, fit
from ._metric import Metric, Nodes, Prepared, Score, metric, metrics
from ._score import compare, score
from ._study import Benchmark, Trained, benchmark, train
from ._vernis import __version__

__all__ = [
    "Benchmark",
    "Brdf",
    "Cost",
    "Error",
    "Fit",
    "Grid",
    "InputError",
    "Material",
    "Metric",
    "Model",
    "Nodes",
    "NotFoundError",
    "Parameter",
    "Prepared",
    "Score",
    "Table",
    "Trained",
    "UnknownNameError",
    "__version__",
    "benchmark",
    "compare",
    "export",
    "fit",
    "metric",
    "metrics",
    "model",
    "models",
    "open",
    "quote",
    "score",
    "train",
]


def quote(name: str = "vernis") -> str:
    """What to write beside numbers of a metric, so that they can be made again: its name, its version, and that of the program."""
    return metric(name).quote()
