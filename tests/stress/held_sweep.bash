# What scripts of clusters share, to be sourced in the root of the checkout, with $PYTHON and a folder
# $work: a sweep of 8 points, each of which waits as long as the file $HOLD exists.
export HOLD=$work/hold PYTHONPATH=$work
cat > "$work/held.py" << 'END'
import os, time
from dataclasses import dataclass
from mlci.systems import DoubleIntegrator


@dataclass(frozen=True, eq=False)
class Held(DoubleIntegrator):
    def dynamics(self, states, controls):
        # A config is tried with few states before any work.
        while len(states) > 100 and os.path.exists(os.environ["HOLD"]):
            time.sleep(0.1)
        return super().dynamics(states, controls)
END
sweep() { # FOLDER MORE...: the sweep into a folder
    "$PYTHON" experiments/run.py -m scale=smoke truth=wall system._target_=held.Held \
        grid.shape=[8,8] safety.shape=[21,21] demonstrations.pairs=4 demonstrations.keep=2 \
        'truth.boxes=[{lower:[-0.6,null],upper:[0.6,null]}]' hypotheses.shape=[5,null] \
        dt=0.25,0.5 actions=3,5 seed=0,1 study=s results="$@"
}
