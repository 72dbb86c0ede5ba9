"""Attributes of MJCF that cannot change the dynamics of bodies and joints, whatever they say."""

#: Names, looks, and what only fills memory.
_LOOKS = {"name", "user", "group", "rgba", "material", "castshadow", "texturedir", "assetdir"}

#: Contacts, limits and their solver.
_CONTACTS = {
    "solref", "solimp", "solreflimit", "solimplimit", "solreffriction", "solimpfriction", "solmix",
    "o_solref", "o_solimp", "gap", "adhesion", "surfacevel", "priority", "margin", "ccd_iterations",
    "ccd_tolerance", "ls_iterations", "ls_tolerance", "noslip_tolerance", "sdf_initpoints",
    "sdf_iterations", "sleep_tolerance", "diagexact", "ipc", "speculative", "fitaabb",
}  # fmt: skip

#: How a file is written, or what is computed besides.
_WRITING = {
    "conflict", "passthrough", "savecanonical", "savecompiled", "accel", "interval", "inttotal",
    "maxforce", "timeconst", "timestep", "tolrange", "useexisting", "uselimit", "content_type",
}  # fmt: skip

#: How a motor makes its force: what it is at the joint is measured.
_CONTROL = {
    "ctrllimited", "ctrlrange", "forcelimited", "forcerange", "lengthrange", "delay", "interp",
    "nsample", "actuatorfrclimited", "actuatorfrcrange", "class", "refsite", "actdim", "actearly",
    "actlimited", "actrange", "dynprm", "dyntype", "ffrange", "gaintype", "inheritrange", "input",
    "velrange", "body", "site", "tendon", "slidersite", "cranksite", "cranklength", "jointinparent",
}  # fmt: skip

#: Of joints in the composites of MuJoCo 3.
_COMPOSITES = {"kind", "solreffix", "solimpfix"}

SILENT = frozenset(_LOOKS | _CONTACTS | _WRITING | _CONTROL | _COMPOSITES)

#: Elements whose attributes the corpus has, each, unless they are silent. Sites have a position
#: alone that matters, and the other motors differ from `motor` in how they make their force.
ELEMENTS = (
    "compiler", "lengthrange", "option", "flag", "body", "inertial", "joint", "freejoint", "geom",
    "connect", "motor", "fixed", "spatial", "pulley",
)  # fmt: skip
