"""Logs and reports in an object store: moto's S3 server on loopback."""

import json
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from support.drives import hill_tables
from support.report_folder import read_rows, statuses

from roadlog.log import DriveLog, create

REGION = "us-east-1"


@pytest.fixture
def store(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """A client of an empty bucket `fleet`; the environment points everybody there."""
    pytest.importorskip("s3fs", reason="s3fs is not installed")
    server_module = pytest.importorskip("moto.server", reason="moto is not installed")
    import boto3

    server = server_module.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "testing")
    monkeypatch.setenv("AWS_DEFAULT_REGION", REGION)
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://{host}:{port}")
    import s3fs

    s3fs.S3FileSystem.clear_instance_cache()  # they know the store of the test before
    client = boto3.client("s3")
    client.create_bucket(Bucket="fleet")
    yield client
    server.stop()


def test_report_from_and_to_an_object_store(
    store: Any, start: Callable[..., subprocess.Popen], tmp_path: Path
) -> None:
    log = tmp_path / "drive.mcap"
    create(log, hill_tables(duration=8.0, rate=20.0))
    for key in ("logs/mon/a.mcap", "logs/tue/b.mcap", "logs/tue/notes.txt"):
        store.put_object(Bucket="fleet", Key=key, Body=log.read_bytes())
    store.put_object(Bucket="fleet", Key="logs/bad.mcap", Body=b"nothing")

    def report(*arguments: object) -> tuple[int, str, str]:
        process = start("report", *arguments, "-e", "level", "--jobs", "1")
        output, errors = process.communicate(timeout=120)
        return process.returncode, output, errors

    code, output, errors = report("s3://fleet/logs", "-o", "s3://fleet/report", "--write-back")
    assert code == 3, errors
    assert "3 logs: 2 ok, 1 failed, 0 crashed" in output
    assert "s3://fleet/logs/bad.mcap: is no MCAP file" in errors
    body = store.get_object(Bucket="fleet", Key="report/rows.jsonl")["Body"].read()
    rows = {row["name"]: row for row in map(json.loads, body.splitlines())}
    assert set(rows) == {"bad.mcap", "mon/a.mcap", "tue/b.mcap"}
    keys = {item["Key"] for item in store.list_objects_v2(Bucket="fleet")["Contents"]}
    assert {"report/index.html", "report/table.parquet", "report/assets/plotly.min.js"} <= keys
    assert f"report/{rows['mon/a.mcap']['detail']}" in keys

    back = tmp_path / "back.mcap"
    store.download_file("fleet", "logs/mon/a.mcap", str(back))
    assert DriveLog(back).estimators == ["level"]

    # the logs as they are now are what the rows are of: nothing is left to do
    arguments = ("-o", "s3://fleet/report", "--write-back", "--resume")
    code, output, _ = report("s3://fleet/logs/*/*.mcap", "s3://fleet/logs/bad.mcap", *arguments)
    assert code == 3
    assert "3 logs, 3 of them done before" in output

    local = tmp_path / "local"
    code, _, _ = report("s3://fleet/logs/tue/b.mcap", "-o", local)
    assert code == 0
    assert statuses(read_rows(local)) == {"ok": 1}


@pytest.mark.parametrize("url", ["s3://fleet/nothing/here", "s3://nowhere/x.mcap"])
def test_nothing_there_is_one_line(
    store: Any, start: Callable[..., subprocess.Popen], tmp_path: Path, url: str
) -> None:
    del store
    process = start("report", url, "-o", tmp_path / "report")
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 1
    (line,) = errors.strip().splitlines()
    assert url in line
    assert not (tmp_path / "report").exists()


def test_an_object_that_was_changed_meanwhile_stays(
    store: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By If-Match, and by the etag where a store or its client knows no conditions."""
    from roadlog.report import row, sources

    create(tmp_path / "a.mcap", hill_tables(duration=8.0, rate=20.0))
    foreign = b"another program wrote this" * 10
    put_back = sources.put_back
    for is_conditional in (True, False):
        store.upload_file(str(tmp_path / "a.mcap"), "fleet", "changed/a.mcap")
        (source,) = sources.find(["s3://fleet/changed"])

        def late(source: sources.FoundLog, path: Path) -> sources.FoundLog:
            store.put_object(Bucket="fleet", Key="changed/a.mcap", Body=foreign)
            return put_back(source, path)

        monkeypatch.setattr(row, "put_back", late)
        if not is_conditional:
            monkeypatch.setattr(sources, "SINGLE_PUT", 0)
        made = row.run_log(source, row.Options(("lowpass_attitude",), write_back=True)).row
        assert made["status"] == "failed"
        assert "another program" in made["message"]
        assert store.get_object(Bucket="fleet", Key="changed/a.mcap")["Body"].read() == foreign


@pytest.mark.parametrize("name", ["../escaped.txt", "a/../../escaped.txt", "/abs.txt", "a\\b.txt"])
def test_a_key_stays_below_its_folder(store: Any, tmp_path: Path, name: str) -> None:
    from roadlog.errors import LogReadError
    from roadlog.report.sources import download_report

    store.put_object(Bucket="fleet", Key=f"report/{name}", Body=b"from the store")
    inner = tmp_path / "inner"
    inner.mkdir()
    with pytest.raises(LogReadError, match="does not stay below"):
        download_report("s3://fleet/report", inner)
    assert list(tmp_path.rglob("*")) == [inner]


def test_a_report_of_others_stays(
    store: Any, start: Callable[..., subprocess.Popen], tmp_path: Path
) -> None:
    create(tmp_path / "a.mcap", hill_tables(duration=8.0, rate=20.0))
    store.put_object(Bucket="fleet", Key="site/index.html", Body=b"precious")
    command = ["report", tmp_path / "a.mcap", "-o", "s3://fleet/site", "-e", "level", "--jobs", "1"]
    process = start(*command)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 1
    assert "holds index.html and is no report" in errors
    assert store.get_object(Bucket="fleet", Key="site/index.html")["Body"].read() == b"precious"
