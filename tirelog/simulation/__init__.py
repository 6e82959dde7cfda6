"""The truth: logs with known physics, solved apart from the models that are tested on them.

    SCENARIO.toml --load_scenario--> Scenario --simulate--> Simulated
        --write_log-----> LOG, LOG.truth.json, setup
        --to_recording--> Recording in memory

Nothing here is shared with `tirelog.physics`, and neither imports the other.  Two kinds of truth:

    beam, ring      steady at every instant (`World`): a fine closed grid with difference operators
                    (order eight), contact by an active set
    coupled_ring    a tire that moves (`RolledWorld`): finite elements that turn with the belt
                    (`rolling.belt`), on a hub, over a road (`rolling.world`), stepped in time
                    (`rolling.step_kernel`) through the whole log

Sensors and drive are sampled from that.  P1 to P4 are the papers of the README.
"""

from tirelog.simulation.scenario.schema import Scenario, load_scenario, scenario_of
from tirelog.simulation.simulate import Simulated, setup_text, simulate, to_recording, write_log

__all__ = [
    "Scenario",
    "Simulated",
    "load_scenario",
    "scenario_of",
    "setup_text",
    "simulate",
    "to_recording",
    "write_log",
]
