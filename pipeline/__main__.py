"""`python -m pipeline` is the same as `davinci-forces`."""

from pipeline.cli import main

if __name__ == "__main__":
    main()
