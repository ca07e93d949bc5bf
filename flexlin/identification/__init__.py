"""From a measured log to numbers of the scene: logs, predictions, maximum likelihood."""

from flexlin.lazy import load_lazily

__getattr__, __dir__, __all__ = load_lazily(
    __name__,
    {
        "identification.log": "Log read_log",
        "identification.maximum_likelihood": "Identification identify",
        "identification.prediction": "predict Prediction",
    },
    within={
        "identification.equations": "Logged",
        "identification.prediction": "prepare",
        "identification.shooting": "Windows",
    },
)
