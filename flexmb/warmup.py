"""`python -m flexmb.warmup`: see `flexmb.run.warm_up`."""

from flexmb.run.warm_up import main

if __name__ == "__main__":
    main()
