"""What a cell prints, whole: a kernel passes it on in pieces, and myst-nb would end every piece
with a line of its own, in the middle of a word."""

from myst_nb.core import render

_coalesce = render.coalesce_streams


def joined(outputs):
    """The outputs of a cell, all pieces of a stream in one; myst-nb then cleans them."""
    whole, streams = [], {}
    for output in outputs:
        stream = output["output_type"] == "stream" and output["name"]
        if stream in streams:
            streams[stream]["text"] += output["text"]
            continue
        whole.append(output.copy())
        if stream:
            streams[stream] = whole[-1]
    return _coalesce(whole)


def setup(app):
    render.coalesce_streams = joined
    return {"parallel_read_safe": True, "parallel_write_safe": True}
