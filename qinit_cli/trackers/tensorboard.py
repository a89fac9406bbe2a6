"""Runs as event files of TensorBoard, the same bytes each time."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

from qinit_cli.output_file import OutputFile
from qinit_cli.trackers.run_record import Logged, Plain, RunRecord, package

FOLDER = "tensorboard"
MAKER = "qinit log"
HPARAMS = "hparams"  # the plug-in that shows parameters; its messages are version 0


def log(record: RunRecord, project: str, where: str | None) -> Logged:
    """One event file in WHERE/PROJECT/NAME-HASH, that of TensorBoard's run: scalars, and the parameters for its HParams page."""
    content = _events(record)
    unique = f"{record.name}-{record.content_sha256[:8]}"
    path = Path(where or FOLDER) / project / unique / f"events.out.tfevents.{record.time:.0f}.qinit"
    file = OutputFile(path, False, MAKER, MAKER.encode(), "give -o another folder")
    if file.settle(content):
        return Logged(str(path), False)
    path.parent.mkdir(parents=True, exist_ok=True)
    file.write(content)
    return Logged(str(path), True)


def _events(record: RunRecord) -> bytes:
    _, events, records, hparams, summaries, types = package(
        "tensorboard",
        "compat.proto.event_pb2",
        "summary.writer.record_writer",
        "plugins.hparams.plugin_data_pb2",
        "compat.proto.summary_pb2",
        "compat.proto.types_pb2",
    )
    out = io.BytesIO()
    writer = records.RecordWriter(out)

    def write(**event: Any) -> None:
        writer.write(events.Event(wall_time=record.time, **event).SerializeToString(deterministic=True))

    def of_session(name: str, data: Any) -> Any:
        value = summaries.Summary.Value(tag=f"_{HPARAMS}_/{name}")
        value.metadata.plugin_data.plugin_name = HPARAMS
        value.metadata.plugin_data.content = data.SerializeToString(deterministic=True)
        value.tensor.dtype = types.DT_FLOAT  # of nothing: what is said stands in the metadata
        value.tensor.tensor_shape.SetInParent()
        return summaries.Summary(value=[value])

    write(file_version="brain.Event:2", source_metadata=events.SourceMetadata(writer=MAKER))
    begun = hparams.HParamsPluginData(version=0)
    begun.session_start_info.start_time_secs = record.time
    parameters = {"content_sha256": record.content_sha256, **record.parameters}
    for name, value in parameters.items():
        setattr(begun.session_start_info.hparams[name], _member(value), value)
    write(summary=of_session("session_start_info", begun))
    for step, numbers in record.steps():
        write(step=step, summary=_scalars(summaries, numbers))
    last = len(next(iter(record.curves.values())))
    write(step=last, summary=_scalars(summaries, record.summary))
    ended = hparams.HParamsPluginData(version=0)
    ended.session_end_info.end_time_secs = record.time
    ended.session_end_info.status = 1  # STATUS_SUCCESS
    write(summary=of_session("session_end_info", ended))
    return out.getvalue()


def _scalars(summaries: Any, numbers: dict[str, float]) -> Any:
    """TensorBoard's scalars are float32."""
    return summaries.Summary(
        value=[summaries.Summary.Value(tag=name, simple_value=number) for name, number in numbers.items()]
    )


def _member(value: Plain) -> str:
    """Which of a message's members holds it; bool before the numbers, which it would pass for."""
    kinds = {bool: "bool_value", str: "string_value"}
    return kinds.get(type(value), "number_value")
