"""`python -m davinci_forces` is the same as `davinci-forces`."""

from davinci_forces.cli import main

if __name__ == "__main__":
    main()
