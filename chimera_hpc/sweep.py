"""What ``python -m chimera_hpc.sweep`` runs: the command line, see `chimera_hpc.cli`."""

from chimera_hpc.cli.main import main, run

__all__ = ["main"]

if __name__ == "__main__":
    run()
