"""What ``python -m chimera_hpc.sweep`` runs: the command line, see `chimera_hpc.cli`."""

from chimera_hpc.base.current_folder import leave_current_folder

if __name__ == "__main__":
    # Before anything is imported that a file in the current folder could stand in for.
    leave_current_folder()

from chimera_hpc.cli.main import main, run

__all__ = ["main"]

if __name__ == "__main__":
    run()
