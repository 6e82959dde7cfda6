"""A model against a measurement: where it fails, which effect it lacks, and how the error falls once that effect is in.

What flows through it (n revolutions, m angles, C cells, N = C m values, p parameters of the base model):

    Recording + passages
      -> `samples`, `align`, `manoeuvres`, `stack`   Stack (n, m): raw bin means at their real angles, with conditions, manoeuvre, regime;
                      of a long log several, one after the other; `stacks` puts them aside in a file once they are many
      -> `measured`   the one door: the same without the revolutions that an obstacle disturbs, with notes on what was set apart
      -> `pieces`     Pieces (P, m), stack by stack: means of like revolutions (one manoeuvre, a narrow band of speed); each revolution's
                      amplitude, shift and baseline taken out before the mean; `gathering` keeps them few, however long the logs
      -> `cells`      Cells (C, m), C = P: what was taken out comes back as random effects of the cell
      -> `whitening`  one linear operator per manoeuvre: scales by the noise, removes the shift, shrinks along the random effects
                      (amplitude and baseline of revolutions; load and baseline of manoeuvres)
      -> `fitting`    base model's parameters by damped least squares in whitened space, several starts, one free offset per log
      -> `signatures` for every candidate the change of prediction by its parameters, columns (N, k)
      -> `projection` base Jacobian and nuisances out of residual and signatures; normal matrices per manoeuvre
      -> `selection`  joint sign flips of manoeuvres with the maximum over candidates; leave-one-manoeuvre-out gain; the size rule
      -> `naming`     refits of the best, sets that cannot be told apart, what survives freedom of shape for a second effect
      -> `leftover`   what is left, in physical words;  `separation` the manoeuvre that would part rivals
      -> `results`    Comparison, Diagnosis, Ladder: frozen, JSON-serialisable, with waveforms, bands and maps for plots and pages

Logs that met an obstacle (their setup has a [road]) take a way beside: `measured` has `transient_log` find the hits and keeps the
disturbed revolutions out of the stack, `transient_fit` lays a coupled ring's answer on them, `transient` gives the errors in time and
frequency, `transient_learn` fits what only a motion tells.

Entry points: `measured(recordings, observable)`, and with its `stacks` `compare(stacks, model)`, `diagnose(stacks, model)`,
`ladder(stacks, model)`, `fitted.fit_measured(stacks, model)`.  `stacks_from_logs` alone does not look for obstacles.
A stack with one angle (m = 1) is a number per revolution (patch_length, ...): the same machinery without shift and amplitude.

Two scales, never mixed.  *Significance* is judged in whitened units, with the manoeuvre as the unit of replication.  *Size* is judged in
the
observable's unit: rmse and floor are those of one revolution's value at one angle, so a floor of 1e-6 means what it says on the plot.
"""

from tirelog.discrepancy.comparison import compare
from tirelog.discrepancy.diagnosis import Diagnosis, diagnose
from tirelog.discrepancy.ladder import ladder
from tirelog.discrepancy.measured import MeasuredLogs, measured
from tirelog.discrepancy.results import Comparison, Ladder
from tirelog.discrepancy.stack import stacks_from_logs

__all__ = ["Comparison", "Diagnosis", "Ladder", "MeasuredLogs", "compare", "diagnose", "ladder", "measured", "stacks_from_logs"]
