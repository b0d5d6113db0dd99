"""What the paper and the literature say that the model can be asked for: the rows of the page.

Nothing is computed here: `validation.py` asks the model for each row's `key`.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from jaxglide.ensemble.published import (
    HEIGHT_INCREASE,
    HEIGHT_SHARE,
    PATH_INCREASE,
    PATH_LENGTH,
    PATH_SHARE,
    STABLE,
)


@dataclass(frozen=True)
class Row:
    """A number, or a statement, of a source.

    Attributes:
        section: heading under which it stands.
        quantity: what it is of, with its unit.
        source: where it stands; a letter in brackets is one of `SOURCES`.
        published: the number as printed there, with a spread where it has one, or the words.
        key: of what the model says.
        test: the test that holds it, below tests/.
        why: why ours differs, where it does.
        words: whether it is a statement, which ours bears out or not.
        loose: whether ours differs a little from machine to machine.
        page: of the findings, where ours is read there and not computed; "" otherwise.
    """

    section: str
    quantity: str
    source: str
    published: str
    key: str
    test: str
    why: str = ""
    words: bool = False
    loose: bool = False
    page: str = ""


SOURCES = {
    "Y": "I. J. Yeaton, S. D. Ross, G. A. Baumgardner, J. J. Socha, Undulation enables gliding "
    "in flying snakes, *Nature Physics* 16, 974–982 (2020), "  # noqa: RUF001
    "[doi:10.1038/s41567-020-0935-4](https://doi.org/10.1038/s41567-020-0935-4): the paper",
    "C": "figures computed with the research code of that study, at its settings, more digits "
    "of table S1 included; kept in `tests/golden` and in `jaxglide/ensemble/published.py`",
    "H": "D. Holden, J. J. Socha, N. D. Cardwell, P. P. Vlachos, *Journal of Experimental "
    "Biology* 217, 382–394 (2014), "  # noqa: RUF001
    "[doi:10.1242/jeb.090902](https://doi.org/10.1242/jeb.090902): sections in a water tunnel",
    "K": "A. Krishnan, J. J. Socha, P. P. Vlachos, L. A. Barba, *Physics of Fluids* 26, 031901 "
    "(2014), [doi:10.1063/1.4866444](https://doi.org/10.1063/1.4866444): flow round a section, "
    "computed in two dimensions",
    "S": "J. J. Socha, T. O'Dempsey, M. LaBarbera, *Journal of Experimental Biology* 208, "
    "1817–1833 (2005), "  # noqa: RUF001
    "[doi:10.1242/jeb.01579](https://doi.org/10.1242/jeb.01579): 14 animals filmed from 9.62 m",
    "Q": "I. J. Yeaton, S. D. Ross, J. J. Socha, Quasi-steady aerodynamic theory "
    "under-predicts glide performance in flying snakes, *Journal of Experimental Biology*: "
    "forces from measured accelerations",
    "I": "an independent computation from the same equations, not published",
}

THIS = "project/test_validation.py::test_a_run_says_what_the_page_says"
FIGURE_4 = "project/test_experiments.py::test_figure_4"
FLIGHTS = "project/test_experiments.py::test_measured_flights"
FITS = "project/test_experiments.py::test_fit_forces"
MOMENTS = "tunnel/test_windtunnel.py::test_moments_are_the_published_ones"
BENT = "ensemble/test_published.py::TestFigure5::"
OVERSHOT = "the published sums run one 10 ms step past the end"
MINUS = "\N{MINUS SIGN}"


def _animal() -> Iterator[Row]:
    section = "The animal, its waves and its launch"
    line = "shape/test_gait.py::test_degrees_and_the_published_line"
    launch = "flight/test_launch.py::test_against_the_published_code"
    sizes = "body/test_snake.py::test_numbers_of_the_published_animal"
    speed = "flight/test_launch.py::test_published_speed_grows_with_the_root_of_wing_loading"
    neck = "shape/test_gait.py::test_neck_ramps_linearly_from_the_snout"
    scaled = "1.7 m/s is scaled with the root of wing loading, as in the research code"
    node = "the research code ends it at a node of its 1 cm grid"
    for row in (
        ("mass at 70 cm (g)", "[Y] fig. 4", "38", "mass", sizes),
        ("neck (% of SVL)", "[Y] Methods", "7.5", "neck", neck, node),
        ("shapes", "[Y] text", "121", "shapes", f"{_SIZES}"),
        ("least θ_m of the shapes (°)", "[Y] text", "90", "theta_low", line, "rounded there"),
        ("largest θ_m of the shapes (°)", "[Y] text", "119", "theta_high", line),
        ("launch speed (m/s)", "[Y] Methods", "1.7", "speed", speed, scaled),
        ("launch phase, ν_θ 1.4 (rad)", "[C]", f"{MINUS}0.027816", "phase", launch),  # noqa: RUF001
        ("launch yaw (°)", "[C]", f"{MINUS}0.22388", "yaw", launch),
        ("launch pitch (°)", "[C]", f"{MINUS}4.55923", "pitch", launch),
        ("launch roll (°)", "[C]", f"{MINUS}4.52628", "roll", launch),
    ):
        quantity, source, published, key, test, *why = row
        yield Row(section, quantity, source, published, key, test, "".join(why))


_SIZES = "ensemble/test_published.py::test_regions_have_the_published_sizes"


def _sections() -> Iterator[Row]:
    section = "Forces on a section of the body"
    test = "loads/test_polar.py::test_measured_values"
    yield Row(section, "largest C_L", "[H] abstract", "1.9", "most_lift", test)
    yield Row(section, "it grows up to (°)", "[H] abstract", "35", "stall", test)
    yield Row(section, "largest C_L/C_D", "[H] abstract", "2.7", "most_ratio", test)
    said = "peak of lift at 35° above Re 2000"
    why = "the measured sections have none at Re 3000 to 7000"
    yield Row(section, said, "[K] abstract", "yes", "peak", THIS, why, words=True)


def _shapes() -> Iterator[Row]:
    section = "Table S1, figure 4: 121 shapes"
    test = "ensemble/test_published.py::test_shape_space_at_ten_metres"
    for f_theta in (1.2, 0.0):
        for region, value in STABLE[f_theta].items():
            name = f"stable (%), {f_theta:g} Hz, {region}"
            yield Row(section, name, "[C] [Y] table S1", f"{value:.3f}", name, test)
    for f_theta in (1.2, 0.0):
        for region, value in PATH_LENGTH[f_theta].items():
            name = f"mean path length (m), {f_theta:g} Hz, {region}"
            source = "[C] [Y] table S1"
            yield Row(section, name, source, f"{value:.3f}", name, FIGURE_4, OVERSHOT)
    test = "ensemble/test_published.py::test_table_s1_at_75_metres"
    for what, means in (("height lost", HEIGHT_INCREASE), ("path length", PATH_INCREASE)):
        for region, value in means.items():
            name = f"75 m: mean increase of {what} (m), {region}"
            rest = f"{value:.3f}", name, FIGURE_4, "tumbling glides, and how ends are taken"
            yield Row(section, name, "[C] [Y] table S1", *rest, loose=True)
    for what, shares in (("height lost", HEIGHT_SHARE), ("path length", PATH_SHARE)):
        for region, value in shares.items():
            name = f"75 m: shapes that increase {what} (%), {region}"
            yield Row(section, name, "[C] [Y] table S1", f"{value:.2f}", name, test)
    name = "75 m: where frozen observed shapes travel farther, by (m)"
    why = "four shapes, two of them by more than a metre; how it is averaged is not said"
    yield Row(section, name, "[Y] text", "0.16", "frozen_farther", THIS, why, loose=True)


def _bends() -> Iterator[Row]:
    section = "Figure 5: dorsoventral bending"
    for bend, value in zip((-20, -10, 0, 10, 20), ("3.33", "4.04", "4.79", "5.05", "0.56")):  # noqa: B905
        name = f"mean forward distance, d_ψ {bend}° (m)".replace("-", MINUS)
        test = f"{BENT}test_mean_forward_distance"
        yield Row(section, name, "[C] [Y] fig. 5b", value, f"forward_{bend}", test, loose=True)
    said = (
        (f"{MINUS}20°: every glide becomes unstable in pitch", "bend_down",
         f"{BENT}test_bent_up_they_tumble", "the words are simpler than the model"),
        (f"{MINUS}10° to 10°: every glide is stable", "bend_middle",
         f"{BENT}test_slightly_bent_up_nine_land", f"two of eleven tumble at {MINUS}10°"),
        ("20°: paths curve backward, some end behind the launch", "bend_back",
         f"{BENT}test_bent_down_they_curve_back", ""),
        ("20°: rotationally stable", "bend_up",
         f"{BENT}test_bent_down_they_curve_back", "they yaw past 85°, most near the ground"),
        ("best of the five at 10°, worst at 20°", "bend_best",
         f"{BENT}test_ten_degrees_is_best", ""),
        ("a planar snake (ψ_m 0) performs worst", "planar", THIS, ""),
        ("the same trends with L/D doubled", "forces",
         "project/test_experiments.py::test_force_coefficients", ""),
    )  # fmt: skip
    for words, key, test, why in said:
        yield Row(section, words, "[Y] text", "yes", key, test, why, words=True, loose=True)


def _moments() -> Iterator[Row]:
    section = "Figures 5 d–f and 6: moments in held glides"  # noqa: RUF001
    for nu, bend, value in (
        ("1.0", -20, "-0.15577"), ("1.2", 10, "-0.20828"), ("1.4", 10, "-0.16198"),
        ("1.5", -10, "-0.81733"), ("1.5", 20, "0.64073"),
    ):  # fmt: skip
        name = f"mean pitch moment, ν_θ {nu}, d_ψ {bend}° (N mm)".replace("-", MINUS)  # noqa: RUF001
        key = f"moment_{nu}_{bend}"
        yield Row(section, name, "[C]", value.replace("-", MINUS), key, MOMENTS)
    mean = "ensemble/test_survey.py::test_published_moments_by_bend_and_shape"
    ratio = (
        "ensemble/test_survey.py::"
        "test_published_roll_and_yaw_means_vanish_and_inertial_yaw_dominates"
    )
    figure_5 = "project/test_experiments.py::test_figure_5"
    kept = "in pitch and roll many shapes keep it to the ground"
    said = (
        (f"it rises from {MINUS}20° to 20° and is positive at 20°, mean", "rises", mean, ""),
        ("more waves, more effect of the bend, every shape", "diverges", mean, ""),
        ("it vanishes at a positive bend, every shape", "trims", figure_5, ""),
        ("mean roll and yaw moments are zero", "no_means", ratio, ""),
        ("inertia dominates at the launch, every axis", "launch_ratio", ratio, ""),
        ("inertia always dominates in yaw", "yaw_ratio", ratio, ""),
        ("generally by an order of magnitude", "yaw_median", THIS, "only early in the fall"),
        ("in pitch and roll it leads only at first", "last_ratio", ratio, kept),
        ("extrema of the inertial moments do not change", "inertia", THIS,
         "sixty sampled phases shift with time"),
    )  # fmt: skip
    for words, key, test, why in said:
        yield Row(section, words, "[Y] text, figs 5, 6", "yes", key, test, why, words=True)


def _glides() -> Iterator[Row]:
    section = "Whole glides"
    test = "flight/test_glide.py::test_trajectories_match_the_published_code"
    for name, value, key in (
        ("forward after 1.5 s, ν_θ 1.4 (m)", "3.0141", "path_y"),  # noqa: RUF001
        ("height then (m)", "4.0249", "path_z"),
        ("pitch then (°)", "1.28", "path_pitch"),
    ):
        yield Row(section, name, "[C]", value, key, test)
    short = "quasi-steady forces: see [fitted forces](findings/fitted.md)"
    for name, value, key in (
        ("animals from 9.62 m: distance (m)", "10.14 ± 2.69", "animal_distance"),
        ("sinking speed, ours at the ground (m/s)", "6.4 ± 0.8", "animal_sink"),
        ("horizontal speed, ours at the ground (m/s)", "8.1 ± 0.9", "animal_forward"),
        ("airspeed, ours at the ground (m/s)", "10.0 ± 0.9", "animal_speed"),
        ("least glide angle (°)", "28 ± 10", "animal_angle"),
    ):
        yield Row(section, name, "[S] abstract", value, key, THIS, short)
    said = "no steady glide is reached from 10 m"
    test = "project/test_experiments.py::test_glide_polar"
    yield Row(section, said, "[S] abstract", "yes", "transient", test, words=True)


def _measured() -> Iterator[Row]:
    section = "Measured gaits and flights"
    gap = "gaps filled by a textbook smoother"
    for name, value, key in (
        ("spatial frequency, vertical over horizontal", "1.87", "spatial frequency"),
        ("standard deviation of this ratio", "0.35", "spatial ratio"),
        ("temporal frequency, vertical over horizontal", "1.98", "temporal frequency"),
        ("standard deviation of that ratio", "0.21", "temporal ratio"),
        ("θ_m by ν_θ, slope (°)", f"{MINUS}66", "theta_m by"),  # noqa: RUF001
        ("θ_m by ν_θ, intercept (°)", "188", "theta_m where"),  # noqa: RUF001
        ("first mode, horizontal (%)", "88", "first mode, horizontal"),
        ("first mode, vertical (%)", "66", "first mode, vertical"),
        ("modes for 95 %, vertical", "4", "modes for"),
    ):
        source = "[Y] text, fig. 2"
        yield Row(section, name, source, value, key, FLIGHTS, gap, page="measured")
    for name, value, key in (
        ("ν_θ", "1–1.5", "nu_theta"),  # noqa: RUF001
        ("f_θ (Hz)", "1–1.7", "f_theta"),  # noqa: RUF001
        ("θ_m (°)", "80–120", "theta_m,"),  # noqa: RUF001
        ("ψ_m (°)", "20–45", "psi_m"),  # noqa: RUF001
        ("d_ψ (°)", f"{MINUS}20–30", "d_psi"),  # noqa: RUF001
    ):
        rest = "[Y] text", value, key, FLIGHTS
        yield Row(section, f"range of {name}", *rest, words=True, page="measured")
    for words, key, why in (
        ("simulated distances are slightly less than measured", "distance", "two thirds"),
        ("simulated glides usually shallow", "shallow", ""),
    ):
        rest = "[Y] text, fig. 3", "yes", key, FLIGHTS, why
        yield Row(section, words, *rest, words=True, page="measured")
    for name, value, key in (
        ("lift under-predicted: true over model", "1.35", "lift"),
        ("drag over-predicted: true over model", "0.71", "drag"),
    ):
        why = "within 1.2 standard deviations; another method"
        yield Row(section, name, "[Q] abstract", value, key, FITS, why, page="fitted")


def _turning() -> Iterator[Row]:
    section = "Turning by inertia alone, no air: yaw in a cycle"
    test = "flight/test_moving_shapes.py::test_a_biased_gait_turns_by_inertia_alone"
    yaw = ("0.12", "10.54", "20.97", "31.36", "46.75", "61.79")
    for bias, value in zip((0, 10, 20, 30, 45, 60), yaw):  # noqa: B905
        name = f"lateral bias {bias}° (°)"
        yield Row(section, name, "[I]", f"{MINUS}{value}", f"turn_{bias}", test)


ROWS = tuple(
    row
    for rows in (_animal, _sections, _shapes, _bends, _moments, _glides, _measured, _turning)
    for row in rows()
)
