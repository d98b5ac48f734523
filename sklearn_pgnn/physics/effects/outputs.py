"""Effects on an output: what the sensor shows is not what is."""

from dataclasses import dataclass

from sklearn_pgnn.physics.effect import Effect, quantity


@dataclass(frozen=True)
class OutputEffect(Effect):
    """An output that is replaced by an expression of it."""

    @classmethod
    def targets(cls, model):
        """Name the outputs of the model."""
        return tuple(model.outputs)

    def shown(self, y, p):
        """Give what the sensor shows of the true output."""
        raise NotImplementedError

    def rewrite(self, model, p):
        """Replace the output."""
        outputs = dict(model.outputs)
        outputs[self.target] = self.shown(outputs[self.target], p)
        return {"outputs": outputs}


@dataclass(frozen=True)
class SensorBias(OutputEffect):
    r"""A sensor that is off by a constant, :math:`y + b`.

    Parameters
    ----------
    target : str
        The output.
    bias : float, default=0
        Bias :math:`b` [output].

    Examples
    --------
    >>> SensorBias("phi", bias=0.01).names()
    {'bias': 'by_phi'}
    """

    bias: float = quantity("by", "{target}")
    id = "sensor_bias"
    summary = "The sensor shows a constant too much: a zero that was set wrong."
    check = "Bring the machine to a known position and read the sensor."

    def shown(self, y, p):
        """Give y + b."""
        return y + p["bias"]

    @classmethod
    def starts(cls, target, model, scales):
        """Start without a bias."""
        return (cls(target),)


@dataclass(frozen=True)
class SensorGain(OutputEffect):
    r"""A sensor whose scale is off, :math:`(1 + g)\,y`.

    Parameters
    ----------
    target : str
        The output.
    error : float, default=0
        Relative error :math:`g` of the gain [-].

    Examples
    --------
    >>> SensorGain("phi", error=0.05).names()
    {'error': 'gy_phi'}
    """

    error: float = quantity("gy", "", low=-0.95)
    id = "sensor_gain"
    summary = "The sensor's scale is off: counts per turn, amplifier gain, lever length."
    check = "Move between two known positions and compare the reading's difference."

    def shown(self, y, p):
        """Give (1 + g)*y."""
        return (1 + p["error"]) * y

    @classmethod
    def starts(cls, target, model, scales):
        """Start without an error."""
        return (cls(target),)
