"""Ten seconds of three joints under one sampled PID law at 1 kHz: armdyn, MuJoCo, Drake's Simulator.

The law is u = kp e + ki ∫e dt - kd v + g(q_goal) with the torque clipped. armdyn runs it in C; MuJoCo and Drake call it
as their users write it, in numpy.
"""

import argparse
import json
import time

import numpy as np

import armdyn as ad

SECONDS, RATE = 10.0, 1000.0
KP, KI, KD = 10.0, 10.0, 0.5
START, GOAL = np.array([-1.0, 0.3, -0.2]), np.array([0.3, -0.2, 0.1])


def robot():
    """The paper's third arm without a payload."""
    return ad.Robot.from_spec(ad.ArmSpec.paper("rrr"))


def law(arm):
    """tau(q, v), with a memory of its own."""
    hold = ad.dynamics.inverse_dynamics(arm)(GOAL, 0 * GOAL, 0 * GOAL)
    lower, upper = arm.limits.effort_lower, arm.limits.effort_upper
    integral = np.zeros(3)

    def torque(q, v):
        nonlocal integral
        error = GOAL - q
        wanted = hold + KP * error + KI * integral - KD * v
        clipped = np.clip(wanted, lower, upper)
        integral = integral + np.where((wanted - clipped) * error > 0, 0.0, error) / RATE
        return clipped

    return torque


def own(arm):
    """Armdyn's track: RK4 whose steps are checked."""
    controller = ad.Pid(ad.PidGains(KP, KI, KD))
    loop = ad.Loop(rate=RATE, delay=0, encoder=0.0, velocity="exact")
    reference = ad.set_point(arm, GOAL)
    return lambda: ad.track(arm, reference, controller, loop=loop, duration=SECONDS, q_start=START).trajectory.q[-1]


def mujoco(arm):
    """MuJoCo's Runge-Kutta at the loop's rate, contacts and joint limits off."""
    import mujoco as mj

    model = mj.MjModel.from_xml_string(arm.urdf)
    model.opt.timestep, model.opt.integrator = 1 / RATE, mj.mjtIntegrator.mjINT_RK4
    model.opt.gravity[:] = arm.model.gravity.linear
    model.opt.disableflags |= mj.mjtDisableBit.mjDSBL_CONSTRAINT

    def run():
        data, torque = mj.MjData(model), law(arm)
        data.qpos[:] = START
        for _ in range(int(SECONDS * RATE)):
            data.qfrc_applied[:] = torque(data.qpos, data.qvel)
            mj.mj_step(model, data)
        return data.qpos.copy()

    return run


def drake(arm):
    """Drake's Simulator of a continuous plant, Runge-Kutta 3 with its steps checked, the law at the loop's rate."""
    from drake_collocation import bare_urdf
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
    from pydrake.systems.framework import DiagramBuilder, LeafSystem

    class Sampled(LeafSystem):
        def __init__(self):
            super().__init__()
            self.DeclareVectorInputPort("x", 6)
            self.DeclareStateOutputPort("tau", self.DeclareDiscreteState(3))
            self.DeclarePeriodicDiscreteUpdateEvent(1 / RATE, 0.0, self.update)
            self.torque = law(arm)

        def update(self, context, state):
            x = self.get_input_port(0).Eval(context)
            state.set_value(0, self.torque(x[:3], x[3:]))

    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    text, base = bare_urdf(arm)
    Parser(plant).AddModelsFromString(text, "urdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(base))
    for joint in arm.joint_names:
        plant.AddJointActuator(f"motor_{joint}", plant.GetJointByName(joint))
    plant.Finalize()
    source = builder.AddSystem(Sampled())
    builder.Connect(source.get_output_port(0), plant.get_actuation_input_port())
    builder.Connect(plant.get_state_output_port(), source.get_input_port(0))
    diagram = builder.Build()

    def run():
        simulator = Simulator(diagram)
        ResetIntegratorFromFlags(simulator, "runge_kutta3", 1 / RATE)
        simulator.get_mutable_integrator().set_target_accuracy(1e-6)
        context = simulator.get_mutable_context()
        plant.SetPositionsAndVelocities(plant.GetMyMutableContextFromRoot(context), np.concatenate([START, 0 * START]))
        source.torque = law(arm)
        simulator.AdvanceTo(SECONDS)
        return plant.GetPositions(plant.GetMyContextFromRoot(simulator.get_context()))

    return run


def main():
    """Measure one and print it as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--peer", choices=("armdyn", "mujoco", "drake"), required=True)
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    run = {"armdyn": own, "mujoco": mujoco, "drake": drake}[options.peer](robot())
    end, times = run(), []
    for _ in range(options.repeats):
        begun = time.perf_counter()
        end = run()
        times.append(time.perf_counter() - begun)
    print(json.dumps({"times": times, "off": float(np.abs(end - GOAL).max()), "end": end.tolist()}))


if __name__ == "__main__":
    main()
