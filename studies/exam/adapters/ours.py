"""identifiability: `analyze`, `diagnose` where functions are missing, `predict` and `export`."""

import json

from reading import enter, write_prediction

import identifiability
from identifiability import Case, analyze, diagnose, export, predict


def main(folder, out):
    case = Case.load(folder)
    unseen, case = case.validate, case.with_(validate=())
    analysis = analyze(case, replicates=0)
    result = analysis.to_json(out / "analysis.json")
    found = json.loads((out / "analysis.json").read_text())
    joints = analysis.robot.joints
    answer = {"values": read_values(analysis, found), "columns": read_pairs(joints, found)}
    rolled = getattr(analysis.recordings, "rolled", None)
    if rolled is not None:
        export(case.robot, result, out / "fitted.xml", force=True)
        return answer | {"robot": "fitted.xml", "delay": float(rolled.delays.mean())}
    if found["missing_functions"]:
        diagnosis = diagnose(case, forward=False)
        result = diagnosis.to_json(out / "diagnosis.json")
        answer["effects"] = [f"{e.name} {p.place}" for e in diagnosis.effects for p in e.placements]
    answer["predictions"] = []
    for k, log in enumerate(unseen):
        of_log = predict(case.robot, result, [log])
        file = write_prediction(out, k, of_log.t, of_log.predicted, joints)
        answer["predictions"].append(file)
    return answer


def read_pairs(joints, found):
    order = (found["fit"].get("reading") or {}).get("order", [])
    pairs = [(i, k) for i, k in enumerate(order) if i < k and order[k] == i]
    return [[f"{joints[i]}.tau", f"{joints[k]}.tau"] for i, k in pairs]


def read_values(analysis, found):
    names = [p.name for p in analysis.base.parameters]
    rows = dict(zip(analysis.base.names, analysis.base.G))
    values = []
    for row in (p for p in found["parameters"] if None not in p["interval95"]):
        terms = {n: float(c) for n, c in zip(names, rows[row["name"]]) if abs(c) > 1e-9}
        low, high = row["interval95"]
        called = row["verdict"] == "identifiable"
        ends = {"low": low, "high": high, "called": called}
        values.append({"terms": terms, "value": row["value"], **ends})
    return values


if __name__ == "__main__":
    enter(main, f"identifiability {identifiability.__version__}")
