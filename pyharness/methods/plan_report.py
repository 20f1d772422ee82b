"""The report of `plan`."""

from dataclasses import asdict

from pyharness.methods.plan import Plan
from pyharness.model.records import scene_record
from pyharness.model.report import Report, Table, words
from pyharness.model.scene import Scene
from pyharness.model.scene_report import heading


def plan_report(scene: Scene, plan: Plan) -> Report:
    """Report what is decided for a scene."""
    rows = [[each.part, "yes" if each.kept else "no", each.why] for each in plan.decisions]
    table = Table(words("part computed why"), rows)
    return Report(
        "plan",
        text=[[*heading(scene), f"method: {plan.method}"], [table]],
        record=lambda: {
            "scene": scene_record(scene),
            "plan": {
                "method": plan.method,
                "closed_form": plan.closed_form,
                "decisions": [asdict(each) for each in plan.decisions],
            },
        },
        data=table,
    )
