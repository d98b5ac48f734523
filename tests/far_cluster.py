"""A backend of joblib that stands for a cluster: it has many cores, and may not be given work."""

from joblib.parallel import ThreadingBackend


class FarCluster(ThreadingBackend):
    """As many cores as no computer has; a task that is sent there is an error."""

    def effective_n_jobs(self, n_jobs):
        return 10_000

    def submit(self, func, callback=None):
        raise AssertionError("sent to the cluster")

    apply_async = submit
