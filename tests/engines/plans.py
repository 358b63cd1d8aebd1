"""Random plans for engines: small, with all kinds of controls in all kinds of nesting."""

from __future__ import annotations

from hypothesis import strategies as st

TYPES = ("sequential", "recovery", "parallel_any", "parallel_all")
NAMES = ("a/A", "a/B", "nav2_capabilities/OccupancyGridRunner")


def runner(name: str) -> str:
    return f'<Runner interface="{name}" provider="{name}"/>'


@st.composite
def plans(draw: st.DrawFn, most: int = 6, *, empty: bool = False) -> str:
    """The text of a plan of at most ``most`` runners; ``empty``: a control may hold nothing."""
    left = draw(st.integers(1, most))

    def steps(depth: int) -> str:
        nonlocal left
        parts = []
        for _ in range(draw(st.integers(1, 3))):
            if left <= 0:
                break
            if depth < 3 and draw(st.booleans()):
                inside = "" if empty and draw(st.integers(0, 3)) == 0 else steps(depth + 1)
                if inside or empty:
                    parts.append(
                        f'<Control type="{draw(st.sampled_from(TYPES))}">{inside}</Control>'
                    )
            else:
                left -= 1
                parts.append(runner(draw(st.sampled_from(NAMES))))
        return "".join(parts)

    return f"<Plan>{steps(0) or runner('a/A')}</Plan>"
