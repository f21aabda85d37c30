"""Flies the LM50 bus in Basilisk and prints what test_truth.py compares attjax with.

Needs the extra basilisk (bsk 2.12.1 wrote the file that is kept):

    PYTHONPATH=tests/helpers python tests/data/basilisk_slew.py > tests/data/basilisk_slew.csv

Columns: body (0: principal moments, 1: the rotated, full tensor), the agent step's torque in
N m, then Basilisk's modified Rodrigues parameters (MRP) and angular velocity in rad/s at the
agent step's end, both of the body relative to the inertial frame. The first row of each body
is the start. Basilisk switches to the MRP of the shadow set wherever their norm passes 1.
"""

import numpy as np
from bodies import LM50, rotated_inertia

PERIOD = 4_166_667
"""Length of one RK4 step, ns: Basilisk counts whole nanoseconds, and 1/240 s is not one."""

FRAMESKIP, AGENT_STEPS = 20, 100
START = np.array([0.3, -0.4, 0.2, 0.15, -0.25, 0.3])  # MRP; rad/s


def main():
    print("body,torque_1,torque_2,torque_3,mrp_1,mrp_2,mrp_3,rate_1,rate_2,rate_3")
    rng = np.random.default_rng(0)
    for body, inertia in enumerate((np.diag(LM50), rotated_inertia())):
        torques = np.zeros((AGENT_STEPS, 3))
        axes = rng.integers(0, 3, AGENT_STEPS)
        torques[np.arange(AGENT_STEPS), axes] = rng.choice([0.5, -0.5, 0.05, -0.005], AGENT_STEPS)
        states = [START, *fly(inertia, torques)]
        for torque, state in zip([np.zeros(3), *torques], states):
            print(body, *(f"{x:.17g}" for x in (*torque, *state)), sep=",")


def fly(inertia, torques):
    """MRP and angular velocity (6,) after each agent step, by Basilisk's default, RK4."""
    from Basilisk.simulation import extForceTorque, spacecraft
    from Basilisk.utilities import SimulationBaseClass

    simulation = SimulationBaseClass.SimBaseClass()
    simulation.CreateNewProcess("process").addTask(simulation.CreateNewTask("task", PERIOD))
    craft, effector = spacecraft.Spacecraft(), extForceTorque.ExtForceTorque()
    craft.hub.mHub = 100.0  # kg; no force acts, so that any will do
    craft.hub.r_BcB_B = [[0.0]] * 3
    craft.hub.IHubPntBc_B = inertia.tolist()
    craft.hub.sigma_BNInit = START[:3, None].tolist()
    craft.hub.omega_BN_BInit = START[3:, None].tolist()
    craft.addDynamicEffector(effector)
    simulation.AddModelToTask("task", craft)
    simulation.AddModelToTask("task", effector)
    simulation.InitializeSimulation()
    ticks = 0
    for torque in torques:
        for applied, steps in ((torque, 1), (np.zeros(3), FRAMESKIP)):
            effector.extTorquePntB_B = applied[:, None].tolist()
            ticks += steps
            simulation.ConfigureStopTime(ticks * PERIOD)
            simulation.ExecuteSimulation()
        message = craft.scStateOutMsg.read()
        yield np.array([*message.sigma_BN, *message.omega_BN_B])


if __name__ == "__main__":
    main()
