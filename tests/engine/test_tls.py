"""A cluster behind TLS, with certificates of our own, on the loopback address."""

import shutil
import subprocess

import pytest

from identifiability.foundation.engines.local import Serial, choose_engine

distributed = pytest.importorskip("distributed")

pytestmark = [
    pytest.mark.skipif(shutil.which("openssl") is None, reason="certificates need openssl"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),  # of connections that were refused
]


def certify(folder, name):
    """Make an authority, and a certificate that it signs, as the how-to says."""
    folder.mkdir()

    def openssl(*words):
        subprocess.run(["openssl", *words], cwd=folder, check=True, capture_output=True)

    curve = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"]
    openssl("req", "-x509", *curve, "-days", "2", "-subj", f"/CN={name}", "-keyout", "ca.key",
            "-out", "ca.pem")  # fmt: skip
    openssl("req", *curve, "-subj", "/CN=cluster", "-keyout", "key.pem", "-out", "asked.pem")
    openssl("x509", "-req", "-in", "asked.pem", "-CA", "ca.pem", "-CAkey", "ca.key",
            "-CAcreateserial", "-days", "2", "-out", "cert.pem")  # fmt: skip
    return folder


def settings(folder):
    """Return what Dask's configuration must hold."""
    place = "distributed.comm.tls"
    parts = {
        f"{place}.{who}.{what}": str(folder / f"{what}.pem")
        for who in ("client", "scheduler", "worker")
        for what in ("cert", "key")
    }
    ours = {f"{place}.ca-file": str(folder / "ca.pem")}
    return parts | ours | {"distributed.comm.require-encryption": True}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return certify(tmp_path_factory.mktemp("tls") / "ours", "ours")


@pytest.fixture(scope="module")
def address(folder):
    import dask

    with dask.config.set(settings(folder)):
        cluster = distributed.LocalCluster(
            n_workers=1,
            threads_per_worker=1,
            processes=False,
            protocol="tls://",
            host="127.0.0.1",
            dashboard_address=None,
            security=distributed.Security(),
        )
    with cluster:
        yield cluster.scheduler_address


def test_work_goes_over_tls(address, folder, work):
    import dask

    assert address.startswith("tls://127.0.0.1:")
    with dask.config.set(settings(folder)), choose_engine(scheduler=address) as engine:
        there = list(engine.map(work.solve, range(4)))
    assert [x.tobytes() for x in there] == [x.tobytes() for x in Serial().map(work.solve, range(4))]
