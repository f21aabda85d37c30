"""Flies the LM50 bus about a point Earth in Basilisk and prints what test_disturbances.py wants.

Needs the extra basilisk (bsk 2.12.1 wrote the file that is kept):

    PYTHONPATH=tests/helpers python tests/data/basilisk_gravity.py > tests/data/basilisk_gravity.csv

A circular orbit at 500 km, whose node and flight are NODE and AHEAD in the inertial frame; no
torque but the gravity gradient's. Columns: body, modified Rodrigues parameters and angular velocity
in rad/s, as of basilisk_slew.py, after each EVERY RK4 steps. As in basilisk_wheels.py, a second is
longer there by SLOW.
"""

import numpy as np
from bodies import LM50, rotated_inertia

PERIOD = 4_166_667
"""Length of one RK4 step, ns."""

SLOW = PERIOD * 1e-9 * 240
EVERY, ROWS = 48, 50
START = np.array([0.3, -0.4, 0.2, 0.02, -0.03, 0.01])  # MRP; rad/s
NODE, AHEAD = np.array([0.6, 0.0, 0.8]), np.array([0.48, 0.8, -0.36])
RADIUS, MU = 6.871e6, 3.986004418e14


def main():
    print("body,mrp_1,mrp_2,mrp_3,rate_1,rate_2,rate_3")
    for body, inertia in enumerate((np.diag(LM50), rotated_inertia())):
        for state in [START, *fly(inertia)]:
            print(body, *(f"{x:.17g}" for x in state), sep=",")


def fly(inertia):
    """MRP and angular velocity (6,) after each EVERY steps, by Basilisk's default, RK4."""
    from Basilisk.simulation import GravityGradientEffector, gravityEffector, spacecraft
    from Basilisk.utilities import SimulationBaseClass

    simulation = SimulationBaseClass.SimBaseClass()
    simulation.CreateNewProcess("process").addTask(simulation.CreateNewTask("task", PERIOD))
    craft = spacecraft.Spacecraft()
    earth = gravityEffector.GravBodyData()
    earth.planetName, earth.isCentralBody, earth.mu = "earth", True, MU / SLOW**2
    craft.gravField.gravBodies = spacecraft.GravBodyVector([earth])
    craft.hub.mHub = 100.0  # kg; it falls like any other
    craft.hub.r_BcB_B = [[0.0]] * 3
    craft.hub.IHubPntBc_B = inertia.tolist()
    craft.hub.r_CN_NInit = (RADIUS * NODE[:, None]).tolist()
    craft.hub.v_CN_NInit = ((earth.mu / RADIUS) ** 0.5 * AHEAD[:, None]).tolist()
    craft.hub.sigma_BNInit = START[:3, None].tolist()
    craft.hub.omega_BN_BInit = (START[3:, None] / SLOW).tolist()
    gradient = GravityGradientEffector.GravityGradientEffector()
    gradient.addPlanetName(earth.planetName)
    craft.addDynamicEffector(gradient)
    simulation.AddModelToTask("task", craft)
    simulation.AddModelToTask("task", gradient)
    simulation.InitializeSimulation()
    for row in range(1, 1 + ROWS):
        simulation.ConfigureStopTime(row * EVERY * PERIOD)
        simulation.ExecuteSimulation()
        message = craft.scStateOutMsg.read()
        yield np.array([*message.sigma_BN, *(SLOW * np.array(message.omega_BN_B))])


if __name__ == "__main__":
    main()
