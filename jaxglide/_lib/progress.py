"""How far a long run is."""

import warnings


def progress_bar(total: int, unit: str, show: bool | None, done: int = 0):
    """A bar with rate and time left: on a terminal and in a notebook, silent when piped."""
    with warnings.catch_warnings():  # a notebook without widgets has no bar: no page on that
        warnings.simplefilter("ignore")
        from tqdm.auto import tqdm

    notebook = "notebook" in tqdm.__module__
    disable = None if show is None and not notebook else show is False
    return tqdm(total=total, initial=done, unit=unit, disable=disable, smoothing=0.1)
