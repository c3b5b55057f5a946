"""The live page swims as Python does, and can be used with mouse, keyboard and screen reader."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

import snakebench as sb
from snakebench.controllers import HeldTargets, gait_of
from snakebench.play.page import PRICES, play_page

RESULTS = Path(__file__).parents[2] / "results"
SINUSOID = sb.SinusoidalTorque(amplitude=3.5, frequency=0.70, phase=0.84)
SEA_SNAKE = sb.SeaSnake(amplitude=0.9, frequency=0.6, phase=0.7)
JUMPING = HeldTargets(rate=30.0, targets=tuple(map(tuple, np.random.default_rng(0).uniform(-1, 1, (300, 7)).tolist())))
LINEAR = sb.PeriodicTargets(period=1.7, targets=JUMPING.targets[:12])
PRICE = 10  # place of the price of power on its slider
STUDENTS = {  # files of the results
    "student": "teacher_student/policies/student-*",
    "preference-conditioned student": "learned_front/policies/student-*",
    "robust student": "robust/policies/robust_student-*",
}

pytestmark = pytest.mark.browser

# Centre, angles of the links, their rates and both works after each control step.
SWIM = """({viscosity, drives, gait, steps, dead = 0, delay = 0}) => {
  const swimmer = new Swimmer(PLAY.robot, drives), settings = {fluid: fluidOf(viscosity), price: 0, delay}, rows = [];
  const run = new GaitRun({drives, media: [{name: "", viscosity, gaits: [{gait}], best: [0]}]});
  run.attend(swimmer, settings);
  if (dead) swimmer.dead[dead - 1] = true;
  for (let k = 0; k < steps * PLAY.every; k++) {
    const held = gait.kind === "held-targets" && gait.targets[Math.floor(k / PLAY.every)];
    swimmer.step(settings.fluid, (time, command) => held ? command.set(held) : run.ask(time, command));
    if ((k + 1) % PLAY.every === 0) rows.push([...swimmer.place, ...swimmer.rate, ...swimmer.energy]);
  }
  return rows;
}"""
# What a policy observes and does, and the targets that its servos have at every fourth physics step.
PILOTED = """async ({label, viscosity, price, delay, steps}) => {
  const {card, numbers} = PLAY.policies.find((one) => one.label === label);
  const network = new Network(card, await numbersOf(numbers)), act = network.act.bind(network);
  const seen = [], done = [], held = [];
  network.act = (observation, memory) => {
    seen.push([...observation]);
    done.push([...act(observation, memory)]);
    return done.at(-1);
  };
  const swimmer = new Swimmer(PLAY.robot), run = new PolicyRun(network, swimmer);
  const settings = {fluid: fluidOf(viscosity), price, delay, noise: 0};
  for (let k = 0; k < steps * PLAY.every; k++) {
    run.attend(swimmer, settings);
    if (k % 4 === 0) held.push([...run.target]);
    swimmer.step(settings.fluid, (time, command) => run.ask(time, command));
  }
  return [seen, done, held];
}"""


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    path = tmp_path_factory.mktemp("play") / "play.html"
    path.write_text(play_page(RESULTS), encoding="utf-8")
    return path


@pytest.fixture
def paused(opened, live):
    """Open the page, ready and paused, at a width."""

    def open_page(width=1200, **settings):
        page = opened(live, width, **settings)
        page.wait_for_function("game.playing")
        page.click("#pause")
        return page

    return open_page


@pytest.fixture(scope="module")
def computed(browser, live):
    """What a function of JavaScript makes of numbers, in the page."""
    page = browser.new_page(reduced_motion="reduce")
    page.goto(live.as_uri())
    yield page.evaluate
    page.close()


def rows_of(swim):
    """As SWIM makes them."""
    shown = swim.thinned(8)
    angles = np.cumsum(np.column_stack([shown.head[:, 2], shown.joint_angle]), axis=1)
    rates = np.cumsum(np.column_stack([shown.head_rate[:, 2], shown.joint_rate]), axis=1)
    return np.column_stack([shown.center, angles, shown.center_rate, rates, shown.energy[:, :2]])[1:]


@pytest.mark.parametrize("fluid", ["water", "oil1", "oil2"])
@pytest.mark.parametrize("gait", [SINUSOID, SEA_SNAKE, LINEAR, JUMPING], ids=lambda gait: gait.kind)
def test_the_physics_is_that_of_planar(computed, gait, fluid):
    viscosity = sb.named_fluid(fluid).kinematic_viscosity
    run = {"viscosity": viscosity, "drives": gait.drives, "gait": gait.model_dump(mode="json"), "steps": 300}
    expected = rows_of(sb.simulate(gait, fluid, engine="planar", duration=10.0))
    assert np.abs(np.array(computed(SWIM, run)) - expected).max() < 1e-9


class HeldTorques(HeldTargets):
    drives: ClassVar[str] = "torque"


@pytest.mark.parametrize("kind", [HeldTargets, HeldTorques])
def test_a_servo_is_off_as_in_a_perturbed_planar(computed, kind):
    gait = kind(rate=30.0, targets=JUMPING.targets[:100])
    run = {"viscosity": 2.32e-4, "drives": gait.drives, "gait": gait.model_dump(mode="json"), "steps": 100, "dead": 3}
    where = sb.Scenario(fluid="oil1", engine="planar", duration=100 / 30)
    expected = rows_of(sb.simulate(*sb.perturbed(gait, where, sb.Perturbations(dead_joint=3))))
    assert np.abs(np.array(computed(SWIM, run)) - expected).max() < 1e-9


@pytest.mark.parametrize("gait", [SINUSOID, SEA_SNAKE.but(amplitude=0.3)], ids=lambda gait: gait.kind)
def test_a_gait_comes_late_as_in_python(computed, gait):
    run = {"viscosity": 2.32e-4, "drives": gait.drives, "gait": gait.model_dump(mode="json"), "steps": 300, "delay": 12}
    where = sb.Scenario(fluid="oil1", engine="planar", duration=10.0)
    expected = rows_of(sb.simulate(*sb.perturbed(gait, where, sb.Perturbations(delay=1.5))))
    assert np.abs(np.array(computed(SWIM, run)) - expected).max() < 1e-9  # without a jump that halves a step


@pytest.mark.parametrize("label", STUDENTS)
@pytest.mark.parametrize("fluid", ["water", "oil2"])
def test_policies_act_as_in_python(computed, label, fluid):
    policy = sb.Policy.load(min(RESULTS.glob(STUDENTS[label])))
    policy = policy.at(PRICES[PRICE]) if policy.card.prices else policy
    viscosity = sb.named_fluid(fluid).kinematic_viscosity
    run = {"label": label, "viscosity": viscosity, "price": PRICE, "delay": 0, "steps": 900}
    seen, done, held = map(np.array, computed(PILOTED, run))
    whole, memory, worst = np.zeros(36, np.float32), policy.fresh_memory(), 0.0
    for observation, action in zip(seen.astype(np.float32), done, strict=True):
        whole[policy._columns] = observation
        expected, memory = policy.act(whole, memory)
        worst = max(worst, np.abs(action - expected).max())
    assert worst < 1e-5
    swum = sb.simulate(policy, fluid, engine="planar", duration=30.0).command[:-1:4]
    apart = np.abs(held - swum).max(axis=1)
    assert apart[:600].max() < 2e-4 and apart.max() < 1e-3  # rounding shifts the phase of the swim slowly


def test_commands_come_late_as_in_python(computed):
    policy = sb.Policy.load(RESULTS / "teacher_student" / "policies" / "student-10.safetensors")
    where = sb.Scenario(fluid="oil1", engine="planar", duration=4.0)
    late = sb.simulate(*sb.perturbed(policy, where, sb.Perturbations(delay=1.5))).command[:-1:4]
    run = {"label": "student", "viscosity": 2.32e-4, "price": PRICE, "delay": 12, "steps": 120}
    assert np.array(computed(PILOTED, run)[2]) == pytest.approx(late, abs=2e-4)


def test_noise_reaches_the_sensors(computed):
    noisy = """async (noise) => {
      const {card, numbers} = PLAY.policies[0], network = new Network(card, await numbersOf(numbers)), seen = [];
      network.act = (observation) => { seen.push([...observation]); return observation.slice(0, 7); };
      for (let k = 0; k < 200; k++) new Pilot(network).choose(new Swimmer(PLAY.robot), fluidOf(1e-4), 1, noise);
      return seen;
    }"""
    errors = np.array(computed(noisy, 2)) - np.array(computed(noisy, 0))
    largest = np.abs(errors).max(axis=0)
    assert largest[:7] == pytest.approx(2 * 0.01, rel=0.1)  # joint angles [rad]
    assert largest[7:14] == pytest.approx(2 * 1.5 * 0.1, rel=0.1)  # tenths of joint rates [rad/s]
    assert largest[23] == pytest.approx(2 * 0.2 * 0.2, rel=0.1)  # fifths of the turning rate [rad/s]
    assert not largest[14:23].any() and not largest[24:].any()


@pytest.mark.parametrize("between", [False, True])
def test_the_limit_is_that_of_the_function(computed, between):
    axes, rng = computed("[PLAY.limits.viscosities, PLAY.limits.powers]"), np.random.default_rng(0)
    places = [rng.uniform(axis[0], axis[-1], 60) if between else rng.choice(axis, 60) for axis in axes]
    points = (10.0 ** np.transpose(places)).tolist()
    shown = computed("(points) => points.map(([viscosity, power]) => limitAt(viscosity, power))", points)
    assert sum(speed is not None for speed in shown) > 30
    for (viscosity, power), speed in zip(points, shown, strict=True):
        if speed is not None:
            limit = sb.limit(sb.Fluid(kinematic_viscosity=viscosity), power)
            assert speed == pytest.approx(limit.speed, abs=limit.error * between + 6e-6)  # of five decimals


def test_the_page_is_small_enough_to_send(live):
    assert live.stat().st_size < 3_000_000


def test_the_robots_swim_and_their_values_are_shown(paused):
    page = paused()
    page.evaluate("for (const lane of game.lanes) lane.advance(9 * PLAY.rate, settings); draw(); say()")
    speed = page.inner_text(".lane[data-lane=A] [data-read=speed]")
    share = page.inner_text(".lane[data-lane=A] [data-read=share]")
    assert 0.6 < float(speed.removesuffix(" m/s")) < 0.8
    assert 70 < int(share.removesuffix(" %")) <= 102
    assert page.inner_text("#status").startswith("Lane A, student: 0.")
    pictures = "[...document.querySelectorAll('.play canvas')].map((one) => one.toDataURL())"
    before = page.evaluate(pictures)
    page.evaluate("for (const lane of game.lanes) lane.advance(200, settings); draw()")
    assert all(one != other for one, other in zip(before, page.evaluate(pictures), strict=True))


def test_values_are_the_metrics_of_the_same_motion(paused):
    page = paused()
    page.select_option(".lane[data-lane=A] select >> nth=0", "sea snake")
    page.click("#restart")
    page.evaluate("for (const lane of game.lanes) lane.advance(20 * PLAY.rate + 1, settings); draw()")
    for lane, gait in zip("AB", page.evaluate("game.lanes.map((lane) => lane.controller.now.gait)"), strict=True):
        read = f".lane[data-lane={lane}] [data-read=%s]"
        texts = [page.inner_text(read % name) for name in ("speed", "power", "positive")]
        swim = sb.measure(sb.simulate(gait_of(gait), "water", engine="planar", duration=20.0))
        expected = [swim.speed, swim.power, swim.positive_power]
        assert [float(text.split()[0]) for text in texts] == pytest.approx(expected, rel=0.01, abs=0.005)


def test_each_controller_can_take_over_in_mid_swim(paused):
    page = paused()
    labels = page.evaluate("[...document.querySelector('.lane select').options].map((one) => one.value)")
    assert labels == ["preference-conditioned student", "student", "robust student", *GAITS, ""]
    for label in labels[:-1]:
        page.select_option(".lane[data-lane=B] select >> nth=0", label)
        page.evaluate("game.lanes[1].advance(2 * PLAY.rate, settings)")
        assert page.evaluate("game.lanes[1].swimmer.alive")
    page.select_option(".lane[data-lane=B] select >> nth=0", "")
    assert page.inner_text(".lane[data-lane=B] .about") == "No robot in this lane."


def test_every_control_has_a_name_and_the_keys_work(paused):
    page = paused()
    for role, count in {"slider": 4, "button": 12, "combobox": 3}.items():
        found = page.get_by_role(role)
        assert found.count() == count
        assert all(page.get_by_role(role, name=name, exact=True).count() for name in NAMES[role])
    page.locator("#viscosity").focus()
    page.keyboard.press("End")
    assert page.get_attribute("#viscosity", "aria-valuetext") == "10000 mm²/s"
    page.locator("#lanes").focus()
    page.keyboard.press("ArrowLeft")
    assert page.evaluate("settings.fluid.viscosity") == pytest.approx(10**-2.1)
    page.keyboard.press("3")
    assert page.get_by_role("button", name="Switch off joint 3", pressed=True).count() == 1
    page.keyboard.press("R")
    assert page.evaluate("game.lanes.map((lane) => lane.time)") == [0, 0]
    page.keyboard.press(" ")
    assert page.evaluate("game.playing")


def test_a_paused_page_shows_every_change(paused):
    page = paused()
    page.select_option(".lane[data-lane=B] select >> nth=0", "sinusoid")
    page.evaluate("setFluid(1.14e-6)")
    assert page.inner_text(".lane[data-lane=B] .about").startswith("Gait of water")
    page.evaluate("setFluid(4.79e-3)")
    assert page.inner_text(".lane[data-lane=B] .about").startswith("Gait of oil2")
    picture = "document.querySelector('.lane[data-lane=A] canvas').toDataURL()"
    before = page.evaluate(picture)
    page.evaluate("kill(2)")
    assert page.evaluate(picture) != before


def test_a_takeover_begins_without_torque(paused):
    page = paused()
    page.select_option(".lane[data-lane=B] select >> nth=0", "sinusoid")
    page.evaluate("game.lanes[1].advance(3 * PLAY.rate, settings)")
    page.select_option(".lane[data-lane=B] select >> nth=0", "student")
    page.evaluate("game.lanes[1].advance(1, settings)")
    assert page.evaluate("game.lanes[1].strongest") <= 10


GAITS = ["limit's gait", "sinusoid", "sea snake"]
NAMES = {
    "slider": ["Kinematic viscosity", "Price of power (preference)", "Delay from controller to servos"],
    "button": ["Play", "Restart both", "water", "oil2", "Switch off joint 7"],
    "combobox": ["Lane A", "Lane B", "Lane B: gait of"],
}


def test_it_waits_for_those_who_want_less_motion(computed):
    assert computed("game.playing") is False


@pytest.mark.parametrize("width", [1200, 400, 320])
def test_nothing_is_wider_than_the_screen(paused, width):
    page = paused(width)
    assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_a_finger_drags_a_slider_and_switches_a_joint_off(paused):
    page = paused(390, is_mobile=True, has_touch=True)
    page.locator("#viscosity").scroll_into_view_if_needed()
    box, touch = page.locator("#viscosity").bounding_box(), page.context.new_cdp_session(page).send
    for kind, shares in {"touchStart": [0.2], "touchMove": [0.5, 0.8], "touchEnd": []}.items():
        for share in shares or [None]:
            at = [{"x": box["x"] + share * box["width"], "y": box["y"] + box["height"] / 2}] if shares else []
            touch("Input.dispatchTouchEvent", {"type": kind, "touchPoints": at})
    page.get_by_role("button", name="Switch off joint 3").tap()
    assert page.evaluate("Math.log10(settings.fluid.viscosity)") == pytest.approx(-3, abs=0.2)
    assert 600 < float(page.inner_text("#viscosity-shown").split()[0]) < 1600
    assert page.evaluate("settings.dead") == [joint == 3 for joint in range(1, 8)]
    assert page.get_by_role("button", name="Switch off joint 3", pressed=True).count() == 1
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
