"""Physical consistency: which parameter vectors a real robot can have, and the nearest of them.

What to use when:

- `pseudo_inertia.check_body` says whether ten numbers are a body, and in words why not;
- `feasible_set.PhysicalSet` holds all constraints of a robot (bodies, signs, masses, hulls);
- `certify.certify` proves that base parameters are feasible, or that they are not;
- `project.project` gives the feasible parameters nearest to the data (`build_projection` for many
  data sets of one robot), with a `cad_prior.CadPrior` if wanted.

Data enter as a compressed `least_squares.LeastSquares`.
"""
