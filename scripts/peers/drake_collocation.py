"""Drake's DirectCollocation with SNOPT or IPOPT: the same knots, limits and straight-line start.

`pip install drake`. The plant is read from the robot's URDF without meshes, damping and the joints that are locked.
"""

import xml.etree.ElementTree as ET

import numpy as np
from protocol import INTERVALS, Answer, main, straight_line
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.planning import DirectCollocation
from pydrake.solvers import IpoptSolver, SnoptSolver
from pydrake.trajectories import PiecewisePolynomial

import armdyn as ad

SOLVERS = {"SNOPT": SnoptSolver, "IPOPT": IpoptSolver}


def bare_urdf(robot):
    """The URDF's kinematics and inertias only, and its root link."""
    root = ET.fromstring(robot.urdf)  # noqa: S314  armdyn has checked it
    for link in root.findall("link"):
        for drawn in (*link.findall("visual"), *link.findall("collision")):
            link.remove(drawn)
    for other in (*root.findall("transmission"), *root.findall("gazebo")):
        root.remove(other)
    for joint in root.findall("joint"):
        for part in ("dynamics", "mimic", "safety_controller"):  # pin.aba has no friction either
            for element in joint.findall(part):
                joint.remove(element)
        if joint.get("name") in robot.locked:
            if robot.locked[joint.get("name")] != 0:
                raise ValueError("only joints locked at zero can be made fixed here")
            joint.set("type", "fixed")
    children = {joint.find("child").get("link") for joint in root.findall("joint")}
    base = next(link.get("name") for link in root.findall("link") if link.get("name") not in children)
    return ET.tostring(root, encoding="unicode"), base


def plant_of(robot):
    """A continuous-time plant with a motor at every joint, in the robot's order."""
    text, base = bare_urdf(robot)
    plant = MultibodyPlant(time_step=0.0)
    Parser(plant).AddModelsFromString(text, "urdf")
    if base != "world":
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(base))
    for name in robot.joint_names:
        joint = plant.GetJointByName(name)
        if not plant.HasJointActuatorNamed(name):
            plant.AddJointActuator(name, joint)
    plant.Finalize()
    order = [plant.GetJointByName(name).position_start() for name in robot.joint_names]
    if plant.num_positions() != robot.nv or order != list(range(robot.nv)):
        raise ValueError(f"Drake orders the joints {order}")
    return plant


def check_same_arm(robot, plant, context):
    """Drake and Pinocchio must mean the same arm: gravity torques and inertias at a random pose."""
    q = np.random.default_rng(0).normal(size=robot.nv)
    plant.SetPositions(context, q)
    dynamics = ad.Dynamics(robot)
    np.testing.assert_allclose(plant.CalcMassMatrix(context), dynamics.crba(q), atol=1e-9)
    np.testing.assert_allclose(-plant.CalcGravityGeneralizedForces(context), dynamics.gravity(q), atol=1e-9)


def build(problem, method):
    """Drake's program, ready to solve."""
    robot, limits = problem.robot, problem.limits
    plant = plant_of(robot)
    context = plant.CreateDefaultContext()
    check_same_arm(robot, plant, context)
    collocation = DirectCollocation(
        plant, context, INTERVALS + 1, 1e-4, 0.2, input_port_index=plant.get_actuation_input_port().get_index()
    )
    program = collocation.prog()
    collocation.AddEqualTimeIntervalsConstraints()
    state_lower = np.concatenate([limits.position_lower, -limits.velocity])
    state_upper = np.concatenate([limits.position_upper, limits.velocity])
    for k in range(INTERVALS + 1):
        program.AddBoundingBoxConstraint(limits.effort_lower, limits.effort_upper, collocation.input(k))
        program.AddBoundingBoxConstraint(state_lower, state_upper, collocation.state(k))
    program.AddBoundingBoxConstraint(problem.x_start, problem.x_start, collocation.initial_state())
    program.AddBoundingBoxConstraint(problem.x_goal, problem.x_goal, collocation.final_state())
    collocation.AddFinalCost(collocation.time())

    t, q, v = straight_line(problem)
    states = PiecewisePolynomial.FirstOrderHold(t, np.hstack([q, v]).T)
    torques = PiecewisePolynomial.FirstOrderHold(t[[0, -1]], np.zeros((robot.nv, 2)))
    collocation.SetInitialTrajectory(torques, states)
    start, solver = program.initial_guess(), SOLVERS[method]()

    def solve():
        result = solver.Solve(program, start)
        x, u = collocation.GetStateSamples(result).T, collocation.GetInputSamples(result).T
        found = ad.Trajectory(collocation.GetSampleTimes(result), x[:, : robot.nv], x[:, robot.nv :], u)
        word = "solved" if result.is_success() else str(result.get_solution_result()).rpartition(".")[2]
        return Answer(found, word)

    return solve


if __name__ == "__main__":
    main(build, tuple(SOLVERS))
