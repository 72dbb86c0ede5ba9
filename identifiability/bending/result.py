"""`Bending`: the joints that bend, as the logs show them."""

from dataclasses import asdict, field

from identifiability.foundation.names import Array, NumberByName, Strings
from identifiability.foundation.values import Json, frozen


@frozen
class Response:
    """Torque of the links of a joint over that of rigid links, by frequency.

    Attributes
    ----------
    frequency : (F,) [Hz]
    measured, modelled : (F,)
        Share of the amplitude, from measured torque and from the model of the joints that bend.
    """

    frequency: Array
    measured: Array
    modelled: Array


@frozen
class ElasticJoint:
    """A joint that bends.

    Attributes
    ----------
    joint : str
    stiffness : float [N·m/rad or N/m]
    stiffness_sd : float
        Standard error of the stiffness.
    resonance : float [Hz]
        Of the link with its motor locked, √(stiffness / inertia) / 2π.
    resonance_sd : float [Hz]
        Its standard error.
    damping_ratio : float
    damping : float [N·m·s/rad or N·s/m]
        Of the spring.
    inertia : float [kg·m² or kg]
        Mean inertia of the links that the joint moves.
    gain : float [nat]
        What the fitted logs gain by it, beside the other joints and all rivals.
    response : Response
        Its frequency response.
    """

    joint: str
    stiffness: float
    stiffness_sd: float
    resonance: float
    resonance_sd: float
    damping_ratio: float
    damping: float
    inertia: float
    gain: float
    response: Response

    def to_dict(self) -> Json:
        """Return its numbers for JSON."""
        numbers = asdict(self)
        response = numbers.pop("response")
        return numbers | {"response": {name: x.tolist() for name, x in response.items()}}


@frozen
class Bending:
    """Joints that bend, as logs show them.

    Attributes
    ----------
    joints : tuple of ElasticJoint
        In the order in which they were found.
    asked : tuple of str
        Joints that were asked.
    band : float [Hz]
        Band of the torque that was used.
    bandwidth : float [Hz]
        Bandwidth of the motion.
    error_before, error_after : (n,) [N·m or N]
        Root mean square of what the model leaves of the torque of each joint, in that band: rigid,
        and with the joints that bend.
    held_before, held_after : (n,) or None
        The same on held-out logs.
    lost : str
        Reason, after "because", why nothing was asked; empty if it was.
    parameters : mapping
        Standard parameters of the physically consistent robot with springs, for a simulator.
    rigid : str
        Reason why there is none; empty if there is, or if no joint bends.
    """

    joints: tuple[ElasticJoint, ...]
    asked: Strings
    band: float
    bandwidth: float
    error_before: Array
    error_after: Array
    held_before: Array | None = None
    held_after: Array | None = None
    lost: str = ""
    parameters: NumberByName = field(default_factory=dict)
    rigid: str = ""

    def to_dict(self) -> Json:
        """Return it for JSON."""
        error = {"before": self.error_before, "after": self.error_after}
        unseen = {"before": self.held_before, "after": self.held_after}
        joints = [joint.to_dict() for joint in self.joints]
        rms = {name: x.tolist() for name, x in error.items()}
        rms_unseen = {name: x.tolist() for name, x in unseen.items() if x is not None}
        return {
            "joints": joints,
            "asked": list(self.asked),
            "band": self.band,
            "bandwidth": self.bandwidth,
            "rms": rms,
            "rms_unseen": rms_unseen,
            "lost": self.lost,
            "parameters": dict(self.parameters),
            "rigid": self.rigid,
        }
