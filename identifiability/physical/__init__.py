"""Physical consistency: the physically consistent parameter vectors, and the nearest of them.

What to use when:

- `pseudo_inertia.check_body` checks whether ten numbers are a body, and explains why not;
- `fitted_model.PhysicalSet` holds all constraints of a robot (bodies, signs, bounds);
- `feasibility.certify` proves that base parameters are feasible, or that they are not;
- `project.project` gives the feasible parameters nearest to the data (`project.Projection` for many
  data sets of one robot), with a `cad_prior.CadPrior` if wanted;
- `feasibility.find_nearest` and `feasibility.certify_model` do all of it for a
  `fitted_model.FittedModel`.

Data enter as a compressed `fitted_model.LeastSquares`: `LeastSquares.of_fit` makes it from
`Information` and an estimate, for programs here and for posteriors.
"""
