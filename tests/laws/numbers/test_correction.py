"""What estimates that noise does not bias change of least squares, and along which motions."""

import numpy as np

from identifiability.logs.prepare import instruments as closing
from identifiability.logs.prepare.instruments import complete_along
from identifiability.robot import complete_motion


def test_where_a_loop_stays_open_the_measured_motion_stands(monkeypatch, two_link):
    t = np.linspace(0, 1, 100)
    zero, two = (complete_motion(two_link, t, *np.full((3, 100, 2), x)) for x in (0.0, 2.0))
    monkeypatch.setattr(closing, "complete_motion", lambda *_: two[np.delete(np.arange(100), 7)])
    found = complete_along(two_link, zero, np.full((3, 100, 2), 2.0))
    assert (found.actuated_q[7] == 0.0).all()
    assert (np.delete(found.actuated_q, 7, 0) == 2.0).all()
    monkeypatch.setattr(closing, "complete_motion", lambda *_: two[3:])
    assert complete_along(two_link, zero, np.full((3, 100, 2), 2.0)) is None
