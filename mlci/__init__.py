"""Maximum likelihood constraint inference on discretised continuous dynamics.

Notation. Arrays are indexed by these letters wherever a docstring gives a shape.

======  ====================  =========================================  ==============
letter  name in code          meaning                                    unit
======  ====================  =========================================  ==============
n, m    --                    number of state, control dimensions        --
x       state, states         continuous state, (..., n)                 rad, rad/s, ...
u       control, controls     continuous control, (..., m)               rad/s^2, ...
h       System.dynamics       time derivative of the state, (..., n)     unit of x / s
S       grid.size             number of grid cells (tabular states)      --
A       len(actions)          number of actions                          --
M       mdp.moves             moves of a cell: action x start point      --
W       --                    ways of all cells: moves alike, merged     --
T       steps                 transitions of a tabular trajectory        --
K       --                    samples of a recorded path, less one       --
C       len(constraints)      number of regions (hypotheses)             --
N       --                    number of demonstrations                   --
dt      dt                    time step of the tabular model             s
Z       log_z[t, s]           log partition function to go               nat
Phi     phi[i]                probability of violating region i          --
D       violated[j, i]        demonstration j violates region i          --
L       gain[i]               log likelihood gain of region i            nat
V       values                safe set's value function                  unit of dist_K
======  ====================  =========================================  ==============
"""

# The public modules; inside them, a name without a leading underscore is public.
__all__ = [
    "constraints",
    "demonstrations",
    "demonstrator",
    "escapes",
    "grids",
    "ilqr",
    "inference",
    "maxent",
    "mdp",
    "metrics",
    "online",
    "reachability",
    "recordings",
    "safety_filter",
    "simulate",
    "spaces",
    "systems",
    "ways",
]

__version__ = "0.1.0"
