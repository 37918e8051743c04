"""BRDFs: what they are made from, what they say, what is refused."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import vernis

UP = np.array([0.0, 0.0, 1.0])
AT_45 = np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5)])


def test_a_lambertian_has_its_albedo_over_pi_in_every_shape() -> None:
    grey = vernis.model("lambert", kd=[0.5, 0.25, 0.125])
    expected = np.array([0.5, 0.25, 0.125]) / np.pi
    np.testing.assert_allclose(grey(UP, AT_45), expected, rtol=1e-15)
    many = grey(np.broadcast_to(UP, (4, 5, 3)), AT_45)
    assert many.shape == (4, 5, 3) and many.dtype == np.float64
    np.testing.assert_allclose(many, np.broadcast_to(expected, (4, 5, 3)), rtol=1e-15)
    assert (grey(-UP, UP) == 0).all()
    # float32 directions are unit vectors too.
    assert grey(AT_45.astype(np.float32), UP).shape == (3,)


def test_a_number_stands_for_three_channels() -> None:
    one, three = vernis.model("lambert", kd=0.3), vernis.model("lambert", kd=[0.3, 0.3, 0.3])
    assert one.parameters == three.parameters == {"kd": [0.3, 0.3, 0.3]}
    assert one.model == "lambert" and one.grid is None and one.notation is None


def test_every_model_is_listed_with_bounds_and_can_be_built_at_its_start() -> None:
    found = {m.name: m for m in vernis.models()}
    assert {"ggx", "ward-duer", "lambert", "sgd", "he"} <= set(found)
    for parameter in found["ggx"].parameters:
        assert parameter.lower <= parameter.start <= parameter.upper and parameter.unit
    assert [p.name for p in found["lambert"].parameters] == ["kd.r", "kd.g", "kd.b"]
    total = vernis.model("ggx+ward", **{"1.kd": 0.1, "1.f0": 0.04, "1.alpha": 0.2, "2.ks": 0.1, "2.alpha": 0.1})
    assert total.model == "ggx+ward"


def test_a_table_gives_back_its_values_and_a_copy_in_fortran_order_is_the_same() -> None:
    grid = vernis.Grid.standard(6, 6, 12)
    values = np.random.default_rng(1).random((6, 6, 12, 3)).astype(np.float32)
    table = vernis.Table(values, grid)
    assert table.grid == grid and len(grid) == 432
    np.testing.assert_array_equal(table(*grid.directions()).astype(np.float32), values.reshape(-1, 3))
    fortran = vernis.Table(np.asfortranarray(values), grid)
    strided = vernis.Table(np.concatenate([values, values], axis=1)[:, :6], grid)
    for other in (fortran, strided, vernis.Table(values.astype(np.float64), grid)):
        assert vernis.compare(table, other, ["D9.Cl", "vernis", "ot"]) == {"D9.Cl": 0.0, "vernis": 0.0, "ot": 0.0}


def test_nan_in_a_table_is_not_measured() -> None:
    grid = vernis.Grid.standard(6, 6, 12)
    values = np.full((6, 6, 12, 3), 0.1)
    values[2, 3, 4, 1] = np.nan
    valid = np.ones(grid.shape, dtype=bool)
    valid[1, 1, 1] = False
    found = vernis.Table(values, grid, valid)(*grid.directions()).reshape(6, 6, 12, 3)
    missing = np.isnan(found).all(axis=-1)
    assert missing[2, 3, 4] and missing[1, 1, 1] and missing.sum() == 2


def test_grids_have_the_shapes_of_their_files() -> None:
    assert vernis.Grid.merl().shape == (90, 90, 180) and vernis.Grid.merl(full=True).shape == (90, 90, 360)
    assert vernis.Grid.titopo().shape == (90, 90, 360) and vernis.Grid.titopo(half=True).shape == (45, 45, 180)
    wi, wo = vernis.Grid.standard(3, 3, 4, anchor="edge").directions()
    assert wi.shape == wo.shape == (36, 3)
    np.testing.assert_allclose(np.linalg.norm(wi, axis=1), 1.0)
    np.testing.assert_allclose(wi[0], UP)


def test_a_function_is_a_brdf_and_its_exception_arrives_unchanged(plastic: vernis.Brdf) -> None:
    function = vernis.Brdf.from_function(lambda wi, wo: plastic(wi, wo), name="mine")
    np.testing.assert_array_equal(function(UP, AT_45), plastic(UP, AT_45))
    assert function.name == "mine"
    mine = KeyError("mine")

    def broken(wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        raise mine

    for use in (lambda: vernis.Brdf.from_function(broken)(UP, UP), lambda: vernis.metric("D9.Cl")(plastic, broken)):
        with pytest.raises(KeyError) as raised:
            use()
        assert raised.value is mine
    with pytest.raises(KeyError):
        vernis.metric("vernis").prepare(broken)


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (lambda wi, wo: -np.ones_like(wi), "finite and not negative"),
        (lambda wi, wo: np.full_like(wi, np.nan), "finite and not negative"),
        (lambda wi, wo: np.full_like(wi, np.inf), "finite and not negative"),
        (lambda wi, wo: np.ones(3), "shape"),
        (lambda wi, wo: wi + 1j, "complex128"),
        (lambda wi, wo: None, "object"),
    ],
)
def test_what_a_function_may_not_return(function, said: str, plastic: vernis.Brdf) -> None:
    for metric in ("D9.Cl", "vernis"):
        with pytest.raises(vernis.InputError, match=said):
            vernis.metric(metric)(plastic, function)


def test_models_and_notations_pickle_and_save(plastic: vernis.Brdf, tmp_path) -> None:
    again = pickle.loads(pickle.dumps(plastic))
    assert again.parameters == plastic.parameters
    plastic.save(tmp_path / "plastic.json")
    opened = vernis.open(tmp_path / "plastic.json")
    assert opened.parameters == plastic.parameters and len(opened.sha256) == 64
    assert pickle.loads(pickle.dumps(opened)).notation == opened.notation
    with pytest.raises(vernis.InputError, match="pickled"):
        pickle.dumps(vernis.Brdf.from_function(plastic))


def test_people_see_a_sphere(plastic: vernis.Brdf) -> None:
    assert plastic.png(16).startswith(b"\x89PNG")
    assert "data:image/png;base64," in plastic._repr_html_() and "ggx" in plastic._repr_html_()


@pytest.mark.parametrize(
    ("make", "error", "said"),
    [
        (lambda: vernis.open("nothing.binary"), vernis.NotFoundError, "nothing.binary"),
        (lambda: vernis.open("nothing"), vernis.InputError, "not a BRDF source"),
        (lambda: vernis.open(3), TypeError, "PathLike"),
        (lambda: vernis.model("ggxx", alpha=1), vernis.UnknownNameError, "did you mean ggx"),
        (lambda: vernis.model("ggx", kd=0.1, f0=0.04, aplha=0.1), vernis.UnknownNameError, "did you mean alpha"),
        (lambda: vernis.model("ggx", kd=0.1, f0=0.04), vernis.InputError, "alpha is missing"),
        (lambda: vernis.model("ggx", kd=0.1, f0=0.04, alpha=-1), vernis.InputError, "alpha is -1"),
        (lambda: vernis.model("ggx", kd=[0.1, 0.1], f0=0.04, alpha=0.1), vernis.InputError, "kd has 2 numbers; it must have 3"),
        (lambda: vernis.model("ggx", kd="red", f0=0.04, alpha=0.1), vernis.InputError, "dtype"),
        (lambda: vernis.model("lambert", kd=0.1)(UP, [0, 0, 2]), vernis.InputError, "unit vector"),
        (lambda: vernis.model("lambert", kd=0.1)(UP, [0, 0, np.nan]), vernis.InputError, "unit vector"),
        (lambda: vernis.model("lambert", kd=0.1)(UP, [0, 1]), vernis.InputError, r"\(2,\)"),
        (lambda: vernis.model("lambert", kd=0.1)([UP] * 2, [UP] * 3), vernis.InputError, "the same but for axes of 1"),
        (lambda: vernis.Table(np.ones((6, 6, 12)), vernis.Grid.standard(6, 6, 12)), vernis.InputError, "shape"),
        (lambda: vernis.Table(np.ones((6, 6, 12, 3), complex), vernis.Grid.standard(6, 6, 12)), vernis.InputError, "complex128"),
        (lambda: vernis.Table(-np.ones((6, 6, 12, 3)), vernis.Grid.standard(6, 6, 12)), vernis.InputError, "not negative"),
        (lambda: vernis.Table(np.full((6, 6, 12, 3), np.inf), vernis.Grid.standard(6, 6, 12)), vernis.InputError, "finite"),
        (lambda: vernis.Table(np.full((6, 6, 12, 3), np.nan), vernis.Grid.standard(6, 6, 12)), vernis.InputError, "no valid cell"),
        (lambda: vernis.Table(np.ones((6, 6, 12, 3)), (6, 6, 12)), vernis.InputError, "vernis.Grid"),
        (lambda: vernis.Grid("standard", (6, 6, 12)), vernis.InputError, "anchor"),
        (lambda: vernis.Grid("round", (6, 6, 12)), vernis.InputError, "kind"),
        (lambda: vernis.Grid.standard(6, 0, 12), vernis.InputError, "at least 1"),
        (lambda: vernis.compare(3, UP), vernis.InputError, "reference is a int"),
    ],
)
def test_wrong_input_is_a_typed_error(make, error, said: str) -> None:
    with pytest.raises(error, match=said):
        make()


def test_errors_are_what_python_users_catch() -> None:
    assert issubclass(vernis.InputError, ValueError) and issubclass(vernis.NotFoundError, FileNotFoundError)
    for error in (vernis.InputError, vernis.NotFoundError, vernis.UnknownNameError):
        assert issubclass(error, vernis.Error)
    with pytest.raises(vernis.UnknownNameError) as raised:
        vernis.metric("vernsi")
    assert "vernis" in raised.value.nearest


def test_published_files_open(data) -> None:
    teflon = vernis.open("merl_nbrdf.zip:teflon", data=data)
    assert (teflon(UP, AT_45) > 0).all()
    with pytest.raises(vernis.UnknownNameError) as raised:
        vernis.open("merl_nbrdf.zip:tefon", data=data)
    assert "teflon" in raised.value.nearest
