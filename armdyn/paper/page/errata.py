"""Equations that are wrong as printed, with their corrections; docs/paper.md names the test of each."""

from armdyn.paper.page.mathematics import formula, typeset
from armdyn.show.markup import Html, element, join, table

_EQUATIONS = (
    (
        "(7)",
        r"d_{21} = d_{31} = d_{32} = 0",
        r"d_{ij} = d_{ji}",
        "As printed D is not symmetric and energy is not conserved; and terms of d₁₁, d₁₂, d₁₃ and d₂₃ lack factors.",
    ),
    (
        "(11)",
        r"\cos\theta \approx \theta + \pi/2",
        r"\cos\frac{\pi}{20} = 0.988",
        "A Taylor polynomial about -π/2, good to 1 % up to 0.25 rad. It is used up to π/20, where it is 1.73.",
    ),
    (
        "after (13)",
        r"\det e^{tM} = \cos^2 rt - r\sin^2 rt",
        r"\det e^{tM} = 1",
        "r is negative; the exponential turns at the angular frequency √|r|, not at r.",
    ),
    (
        "(14), (15)",
        r"\tau_1^* = \pm\frac{k}{\det},\ \text{every}\ \frac{2\pi}{r}",
        r"\tau_1^* = \pm\tau_{\mathrm{max}},\ \text{every}\ \frac{\pi}{\sqrt{|r|}}",
        "The printed time and torque have other units. A bang-bang torque is on its limit.",
    ),
    (
        "(16)–(21)",
        r"\tau^* = -B^{\mathrm T}\rho",
        r"\tau^* = -\tau_{\mathrm{max}}\,\mathrm{sgn}(B^{\mathrm T}\rho)",
        "The printed law minimises a time-energy Hamiltonian, with ½ τᵀτ in it, not that of minimum time.",
    ),
    (
        "(28)–(30)",
        r"+ k_D\dot\theta",
        r"- k_D\dot\theta",
        "The error is goal minus angle, so its rate is minus the velocity. As printed the loop's polynomial is "
        "s³ − 10s² + 30s + 50: unstable.",
    ),
    (
        "(31)",
        r"\min \int e\,\mathrm{d}t",
        r"\min \int e^2\,\mathrm{d}t",
        "The integral of e is the holding torque over the integral gain: nothing is left to optimise. An index such "
        "as that of e² has a minimum.",
    ),
    (
        "(35)",
        r"\frac{t_f - t_0}{N} = 1",
        r"\frac{t_f - t_0}{N} \ll t_f",
        "A step of 1 s is longer than Examples 1 to 3.",
    ),
)


def errata_table() -> Html:
    """Printed equation, correction, and the error."""
    names = ("equation", "printed", "right", "why")
    head = [element("th", name, class_="first" if name == "equation" else "text") for name in names]
    body = [
        [
            element("td", number, class_="first"),
            element("td", formula(printed), class_="text formula printed"),
            element("td", formula(right), class_="text formula right"),
            element("td", typeset(why), class_="text"),
        ]
        for number, printed, right, why in _EQUATIONS
    ]
    lead = "Where an equation matters to the numbers. docs/paper.md lists all errata, each with the test that shows it."
    return join([element("p", lead), table([head], body, class_="checks errata")])
