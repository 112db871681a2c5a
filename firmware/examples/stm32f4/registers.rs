//! Registers of the processor, by their names in the reference manual RM0090 of ST and the
//! Armv7-M architecture.

#![allow(unsafe_code, reason = "registers are addresses")]
#![allow(dead_code, reason = "hardware.rs uses more than plant.rs")]

/// A register of 32 bits.
#[derive(Clone, Copy)]
pub(crate) struct Register(usize);

impl Register {
    pub(crate) fn read(self) -> u32 {
        // SAFETY: the constants below are addresses of registers on this processor.
        unsafe { (self.0 as *const u32).read_volatile() }
    }

    pub(crate) fn write(self, value: u32) {
        // SAFETY: as in `read`; each register has one owner, see its module.
        unsafe { (self.0 as *mut u32).write_volatile(value) }
    }

    /// Replaces the bits of `mask`.
    pub(crate) fn modify(self, mask: u32, bits: u32) {
        self.write(self.read() & !mask | bits);
    }

    pub(crate) fn set(self, bits: u32) {
        self.modify(bits, bits);
    }

    pub(crate) fn is_set(self, bits: u32) -> bool {
        self.read() & bits == bits
    }
}

macro_rules! registers {
    ($($(#[$about:meta])* $name:ident = $address:expr;)+) => {
        $($(#[$about])* pub(crate) const $name: Register = Register($address);)+
    };
}

const USART1: usize = 0x4001_1000;
const RCC: usize = 0x4002_3800;
const GPIOA: usize = 0x4002_0000;
const TIM1: usize = 0x4001_0000;
const TIM2: usize = 0x4000_0000;
const TIM3: usize = 0x4000_0400;

registers! {
    USART1_SR = USART1;
    USART1_DR = USART1 + 0x04;
    USART1_BRR = USART1 + 0x08;
    USART1_CR1 = USART1 + 0x0C;
    RCC_CR = RCC;
    RCC_PLLCFGR = RCC + 0x04;
    RCC_CFGR = RCC + 0x08;
    RCC_AHB1ENR = RCC + 0x30;
    RCC_APB1ENR = RCC + 0x40;
    RCC_APB2ENR = RCC + 0x44;
    FLASH_ACR = 0x4002_3C00;
    GPIOA_MODER = GPIOA;
    GPIOA_PUPDR = GPIOA + 0x0C;
    GPIOA_IDR = GPIOA + 0x10;
    GPIOA_BSRR = GPIOA + 0x18;
    GPIOA_AFRL = GPIOA + 0x20;
    GPIOA_AFRH = GPIOA + 0x24;
    TIM1_CR1 = TIM1;
    TIM1_EGR = TIM1 + 0x14;
    TIM1_CCMR1 = TIM1 + 0x18;
    TIM1_CCER = TIM1 + 0x20;
    TIM1_PSC = TIM1 + 0x28;
    TIM1_ARR = TIM1 + 0x2C;
    TIM1_CCR1 = TIM1 + 0x34;
    TIM1_BDTR = TIM1 + 0x44;
    TIM2_CR1 = TIM2;
    TIM2_EGR = TIM2 + 0x14;
    TIM2_CNT = TIM2 + 0x24;
    TIM2_PSC = TIM2 + 0x28;
    TIM2_ARR = TIM2 + 0x2C;
    TIM3_CR1 = TIM3;
    TIM3_SMCR = TIM3 + 0x08;
    TIM3_CCMR1 = TIM3 + 0x18;
    TIM3_CCER = TIM3 + 0x20;
    TIM3_CNT = TIM3 + 0x24;
    TIM3_ARR = TIM3 + 0x2C;
    IWDG_KR = 0x4000_3000;
    IWDG_PR = 0x4000_3004;
    IWDG_RLR = 0x4000_3008;
    SYST_CSR = 0xE000_E010;
    SYST_RVR = 0xE000_E014;
    SYST_CVR = 0xE000_E018;
    NVIC_ISER1 = 0xE000_E104;
    /// Priorities of the interrupts 36 to 39; USART1 is 37.
    NVIC_IPR9 = 0xE000_E424;
    /// Priorities of the system's exceptions; SysTick is the highest byte.
    SHPR3 = 0xE000_ED20;
}
