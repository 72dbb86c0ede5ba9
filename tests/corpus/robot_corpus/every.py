"""All entries of the corpus."""

from robot_corpus import (
    mjcf_actuators,
    mjcf_bodies,
    mjcf_defaults,
    mjcf_equalities,
    mjcf_inertias,
    mjcf_joints,
    mjcf_options,
    urdf,
)
from robot_corpus.entry import Entry

ENTRIES: tuple[Entry, ...] = (
    *mjcf_options.ALL,
    *mjcf_defaults.ALL,
    *mjcf_bodies.ALL,
    *mjcf_joints.ALL,
    *mjcf_inertias.ALL,
    *mjcf_equalities.ALL,
    *mjcf_actuators.ALL,
    *urdf.ALL,
)
