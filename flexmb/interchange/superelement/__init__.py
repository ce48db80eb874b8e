"""Finite-element matrices with interface nodes, reduced to flexible bodies by the method of Craig and Bampton."""

from flexmb.interchange.superelement.element import SuperElement as SuperElement
from flexmb.interchange.superelement.element import SuperElementError as SuperElementError
from flexmb.interchange.superelement.element import super_element as super_element
from flexmb.interchange.superelement.files import read_super_element as read_super_element
from flexmb.interchange.superelement.interface import Tie as Tie
from flexmb.interchange.superelement.interface import interface_of as interface_of
from flexmb.interchange.superelement.reduction import ReducedBody as ReducedBody
from flexmb.interchange.superelement.reduction import SideBySide as SideBySide
from flexmb.interchange.superelement.reduction import compared as compared
from flexmb.interchange.superelement.reduction import reduced as reduced
