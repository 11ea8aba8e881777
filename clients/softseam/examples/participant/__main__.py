"""python -m softseam.examples.participant [--connect ENDPOINT] [--service NAME] [--deployment NAME]"""

from softseam.examples.participant.block import LinearBlock
from softseam_protocol.participant.serve import main

if __name__ == "__main__":
    main(LinearBlock, "block")
