"""The law that commands follow: in proportion to the error, or what else."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from assignments.p_controller.checks.control_law import Law, examine
from grader.measure.motion.steering import Sample


def law(commands, limit=2.84):
    return examine([Sample(*item) for item in commands], limit, 0.9)


ERRORS = [3.0 * 0.95**index for index in range(100)]


class TestLaw:
    @given(gain=st.floats(0.3, 4.0), clamp=st.floats(0.5, 2.84), pause=st.floats(0.0, 0.1))
    def test_a_clamped_line_is_proportional(self, gain, clamp, pause):
        pause = min(pause, 0.3 * clamp / gain)
        verdict = law([(e, 0.0 if e < pause else min(clamp, gain * e)) for e in ERRORS])
        assert verdict.law is Law.PROPORTIONAL
        assert math.isclose(verdict.gain, gain, rel_tol=0.02)
        assert verdict.r2 > 0.99

    def test_a_least_speed_is_a_clamp_too(self):
        verdict = law([(e, max(0.2, 1.5 * e)) for e in ERRORS])
        assert verdict.law is Law.PROPORTIONAL and verdict.r2 > 0.9

    def test_a_constant_far_from_the_goal_is_no_clamp(self):
        verdict = law([(e, 0.5 if e > 0.1 else 1.5 * e) for e in ERRORS])
        assert not (verdict.law is Law.PROPORTIONAL and verdict.r2 >= 0.9)

    @pytest.mark.parametrize("sizes", [(0.5,), (0.3, 1.0), (0.2, 0.6, 1.2)])
    def test_few_values_are_steps(self, sizes):
        commands = [(e, sizes[min(int(e), len(sizes) - 1)]) for e in ERRORS]
        verdict = law(commands)
        assert verdict.law is Law.STEPS and verdict.values == sizes

    def test_an_error_that_is_a_full_turn_off(self):
        shown = [e - math.tau if e > math.pi else e for e in [5.0 * 0.97**i for i in range(120)]]
        raw = [5.0 * 0.97**i for i in range(120)]
        verdict = law([(e, 0.5 * r) for e, r in zip(shown, raw, strict=True)])
        assert verdict.law is Law.NOT_NORMALISED
        assert math.isclose(verdict.gain, 0.5, rel_tol=0.01)

    def test_few_commands_below_the_clamp_are_enough(self):
        commands = [(0.25 + 0.1 * n, 1.0) for n in range(20, 0, -1)]
        verdict = law([*commands, (0.24, 0.96), (0.15, 0.6), (0.09, 0.36), (0.05, 0.0)])
        assert verdict.law is Law.PROPORTIONAL and math.isclose(verdict.gain, 4.0)

    def test_a_stray_command_between_two_phases_is_left_out(self):
        """The last turn towards the goal's position answers another error than its heading."""
        commands = [(-1.74, 0.3), *[(-e / 1.7, -e / 1.7) for e in ERRORS]]
        verdict = law(commands)
        assert verdict.law is Law.PROPORTIONAL and verdict.r2 > 0.99
        assert math.isclose(verdict.gain, 1.0, rel_tol=1e-6)

    def test_strays_by_the_dozen_are_no_law(self):
        commands = [(e, 1.5 * e if number % 8 else -0.1) for number, e in enumerate(ERRORS)]
        verdict = law(commands)
        assert not (verdict.law is Law.PROPORTIONAL and verdict.r2 >= 0.9)

    def test_a_gain_of_the_wrong_sign_is_reported(self):
        verdict = law([(e / 1.2, -0.8 * e / 1.2) for e in ERRORS])
        assert verdict.law is Law.WRONG_SIGN

    def test_either_sense_is_right_near_half_a_turn(self):
        commands = [(-math.pi + 0.05, 1.5 * (math.pi + 0.05)), *[(e, 1.5 * e) for e in ERRORS]]
        assert law(commands, limit=9.0).law is Law.PROPORTIONAL

    def test_noise_is_not_a_law(self):
        verdict = law([(e, math.sin(1000.0 * e)) for e in ERRORS])
        assert not (verdict.law is Law.PROPORTIONAL and verdict.r2 >= 0.9)

    def test_commands_of_zeros_alone_are_no_law(self):
        assert law([(e, 0.0) for e in ERRORS]).law is Law.ZERO

    def test_without_an_error_there_is_no_law(self):
        assert law([(0.01, 0.0)] * 20).law is Law.NOTHING_TO_DO
